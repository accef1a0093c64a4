// The document that the user edits: modules and connections as they are written in the file, with undo and redo.
//
// A content is never changed; each change makes a new one, and the earlier ones are kept.

const KEPT = 200; // steps that can be undone

export class AppDocument {
  #past = [];
  #future = [];
  #count = 0;

  /** `content` is {revision, modules, connections} as the server sends it. */
  constructor(content) {
    this.content = content;
    this.saved = content;
  }

  get changed() {
    return this.content !== this.saved;
  }

  get canUndo() {
    return this.#past.length > 0;
  }

  get canRedo() {
    return this.#future.length > 0;
  }

  undo() {
    this.#future.push(this.content);
    this.content = this.#past.pop();
  }

  redo() {
    this.#past.push(this.content);
    this.content = this.#future.pop();
  }

  module(id) {
    return this.content.modules.find((one) => one.id === id);
  }

  connection(id) {
    return this.content.connections.find((one) => one.id === id);
  }

  /** Add a module with some fields, and return its id. */
  addModule(fields) {
    const id = this.#newId();
    this.#change({ modules: [...this.content.modules, { id, ...fields }] });
    return id;
  }

  /** Add a connection, and return its id. */
  addConnection(source, target, protocol = "") {
    const id = this.#newId();
    this.#change({ connections: [...this.content.connections, { id, source, target, protocol }] });
    return id;
  }

  setModule(id, fields) {
    this.#change({ modules: changed(this.content.modules, new Map([[id, fields]])) });
  }

  setConnection(id, fields) {
    this.#change({ connections: changed(this.content.connections, new Map([[id, fields]])) });
  }

  /** Move boxes: `places` has {x, y} by id. */
  move(places) {
    this.#change({ modules: changed(this.content.modules, places) });
  }

  remove(ids) {
    this.#change({
      modules: this.content.modules.filter((one) => !ids.has(one.id)),
      connections: this.content.connections.filter((one) => !ids.has(one.id)),
    });
  }

  #change(parts) {
    this.#past.push(this.content);
    if (this.#past.length > KEPT) this.#past.shift();
    this.#future = [];
    this.content = { ...this.content, ...parts };
  }

  #newId() {
    this.#count += 1;
    return `n${this.#count}`;
  }
}

function changed(several, fields) {
  return several.map((one) => (fields.has(one.id) ? { ...one, ...fields.get(one.id) } : one));
}
