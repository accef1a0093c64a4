// What is drawn of an application: boxes with their ports, and the links between them.
//
// It is put together from the document, which is edited here, and from the server's view of it, which has ports,
// embedded applications and problems, and comes a moment later.

export const BOX = { width: 210, head: 44, row: 20, foot: 8 };
const GAP = { x: 130, y: 28 };
const IN = new Set(["input", "server"]);

/** The boxes and links of a document and its view. `places` are positions of boxes that the file does not have. */
export function modelOf(content, view, places) {
  const own = new Map(view.modules.filter((one) => one.id).map((one) => [one.id, one]));
  const boxes = content.modules.map((one) => ownBox(one, own.get(one.id)));
  boxes.push(...view.modules.filter((one) => !one.id).map((one, index) => embeddedBox(one, index)));
  const links = linksOf(content, view);
  const byPort = new Map();
  for (const box of boxes) for (const port of box.ports) if (!byPort.has(port.name)) byPort.set(port.name, box);
  boxes.push(...externalBoxes(links, byPort));
  for (const link of links) [link.from, link.to] = [byPort.get(link.source), byPort.get(link.target)];
  const byKey = new Map(boxes.map((box) => [box.key, box]));
  for (const box of boxes) sortPorts(box);
  place(boxes, links, places);
  return { boxes, links, byKey };
}

function ownBox(module, seen) {
  const title = seen?.label || module.name || "no name";
  const { x, y } = module;
  return {
    key: module.id, id: module.id, kind: "own", title, tag: seen?.tag, node: seen?.node ?? module.node ?? "", file: seen?.file,
    waits: seen?.waits ?? [], command: seen?.command ?? `${module.name} ${module.parameters ?? ""}`.trim(), ports: [...(seen?.ports ?? [])], x: x ?? null, y: y ?? null,
  };
}

function embeddedBox(seen, index) {
  return {
    key: `embedded ${index}`, id: "", kind: "embedded", title: seen.label, tag: seen.tag, node: seen.node,
    command: seen.command, file: seen.file, waits: seen.waits, ports: [...seen.ports], x: null, y: null,
  };
}

/** Links as the view has them; new ones, and those whose ends were changed, as the document has them. */
function linksOf(content, view) {
  const seen = new Map(view.connections.filter((one) => one.id).map((one) => [one.id, one]));
  const links = content.connections.map((one) => {
    const found = seen.get(one.id) ?? { key: `${one.source} ${one.target}`, source: one.source, target: one.target, carrier: one.protocol };
    return { ...found, id: one.id, name: one.id };
  });
  const embedded = view.connections.filter((one) => !one.id);
  return [...links, ...embedded.map((one, index) => ({ ...one, name: `embedded link ${index}` }))];
}

/** Boxes for ports that no module opens, one for each first word of their names. */
function externalBoxes(links, byPort) {
  const found = new Map();
  const add = (name, kind) => {
    if (byPort.has(name) || !name) return;
    const title = `/${name.split("/")[1] ?? ""}`;
    if (!found.has(title)) found.set(title, { key: `external ${title}`, id: "", kind: "external", title, command: "other programs", node: "", ports: [], x: null, y: null });
    const box = found.get(title);
    box.ports.push({ name, kind, type: "", described: false });
    byPort.set(name, box);
  };
  for (const link of links) {
    add(link.source, "output");
    add(link.target, "input");
  }
  return found.values();
}

function sortPorts(box) {
  const start = commonStart(box.ports.map((port) => port.name));
  const rows = { left: 0, right: 0 };
  for (const port of box.ports) {
    port.side = IN.has(port.kind) ? "left" : "right";
    port.row = rows[port.side];
    port.label = port.name.slice(start) || port.name;
    rows[port.side] += 1;
  }
  box.height = BOX.head + Math.max(rows.left, rows.right) * BOX.row + BOX.foot;
}

/** The length of the part of names, up to a slash, that they have in common. */
function commonStart(names) {
  if (names.length < 2) return 0;
  let end = 0;
  while (end < names[0].length && names.every((name) => name[end] === names[0][end])) end += 1;
  return names[0].lastIndexOf("/", end - 1) + 1;
}

/** The place of a port in the graph. */
export function portPlace(box, name) {
  const port = box.ports.find((one) => one.name === name);
  const y = box.y + BOX.head + ((port?.row ?? 0) + 0.5) * BOX.row;
  return { x: port?.side === "right" ? box.x + BOX.width : box.x, y };
}

// Places of boxes that have none

function place(boxes, links, places) {
  const without = boxes.filter((box) => {
    const kept = places.get(box.key);
    if (box.x === null && kept) [box.x, box.y] = [kept.x, kept.y];
    return box.x === null || box.y === null;
  });
  if (!without.length) return;
  const placed = boxes.filter((box) => !without.includes(box));
  const top = Math.max(0, ...placed.map((box) => box.y + box.height + GAP.y));
  for (const [key, spot] of arranged(without, links, top)) {
    const box = without.find((one) => one.key === key);
    [box.x, box.y] = [spot.x, spot.y];
    places.set(key, spot);
  }
}

/** Places in columns, by key: a box is right of those from which it gets messages. */
export function arranged(boxes, links, top = 0) {
  const chosen = new Set(boxes);
  const before = new Map(boxes.map((box) => [box, new Set()]));
  for (const { from, to } of links) if (chosen.has(from) && chosen.has(to) && from !== to) before.get(to).add(from);
  const column = new Map();
  const depth = (box, above) => {
    if (column.has(box)) return column.get(box);
    if (above.has(box)) return -1; // a circle
    above.add(box);
    const found = 1 + Math.max(-1, ...[...before.get(box)].map((one) => depth(one, above)));
    above.delete(box);
    column.set(box, found);
    return found;
  };
  const deepest = Math.max(0, ...boxes.map((box) => depth(box, new Set())));
  const most = Math.max(8, Math.ceil(Math.sqrt(2 * boxes.length))); // boxes in a column
  const ordered = [...boxes].sort((one, other) => column.get(one) - column.get(other));
  const columns = [];
  for (const box of ordered) {
    const last = columns.at(-1);
    // A graph of circles and long chains has too many columns with few boxes: then they are filled.
    const same = last && (deepest > most || column.get(last.at(-1)) === column.get(box));
    if (same && last.length < most) last.push(box);
    else columns.push([box]);
  }
  const found = new Map();
  columns.forEach((several, index) => {
    let y = top;
    for (const box of several) {
      found.set(box.key, { x: index * (BOX.width + GAP.x), y });
      y += box.height + GAP.y;
    }
  });
  return found;
}
