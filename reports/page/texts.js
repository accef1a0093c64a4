// The texts of the page in English, German and Italian: all that an operator reads, with their labels.
// Texts of tests are not translated; the names of verdicts are those of the documentation, translated.

const LANGUAGES = ["en", "de", "it"];

const WORDS = {
  // states
  "failed": ["failed", "fehlgeschlagen", "fallito"],
  "error": ["error", "Fehler", "errore"],
  "fixture lost": ["fixture lost", "Aufbau verloren", "allestimento perso"],
  "unexpected pass": ["unexpected pass", "unerwartet bestanden", "superato inatteso"],
  "inconclusive": ["inconclusive", "ohne Aussage", "inconcludente"],
  "interrupted": ["interrupted", "unterbrochen", "interrotto"],
  "blocked": ["blocked", "blockiert", "bloccato"],
  "flaky": ["flaky", "unbeständig", "instabile"],
  "not run": ["not run", "nicht gelaufen", "non eseguito"],
  "skipped": ["skipped", "übersprungen", "saltato"],
  "expected failure": ["expected failure", "erwarteter Fehlschlag", "fallimento atteso"],
  "measured": ["measured", "gemessen", "misurato"],
  "passed": ["passed", "bestanden", "superato"],
  "running": ["running", "läuft", "in corso"],
  "planned": ["planned", "geplant", "previsto"],
  // the run
  "run.waiting": ["waiting for the run", "wartet auf den Lauf", "in attesa dell'esecuzione"],
  "run.running": ["running {n} of {all}", "Test {n} von {all}", "prova {n} di {all}"],
  "run.gone": ["did not end", "nicht zu Ende", "non terminata"],
  "run.unreadable": ["{n} lines of the journal could not be read", "{n} Zeilen des Journals sind unlesbar", "{n} righe del giornale sono illeggibili"],
  "run.stopping1": ["stops after this test; Stop → Now stops it at once", "endet nach diesem Test; Anhalten → Sofort beendet ihn gleich", "si ferma dopo questa prova; Ferma → Subito la ferma adesso"],
  "run.stopping2": ["is being stopped", "wird angehalten", "si sta fermando"],
  "run.test": ["1 test", "1 Test", "1 prova"],
  "run.tests": ["{n} tests", "{n} Tests", "{n} prove"],
  "run.problems": ["{n} of {all} tests with problems", "{n} von {all} Tests mit Problemen", "{n} di {all} prove con problemi"],
  // connection
  "link.connecting": ["connecting", "verbindet", "connessione"],
  "link.live": ["live", "live", "in diretta"],
  "link.reconnecting": ["reconnecting", "verbindet erneut", "riconnessione"],
  "link.complete": ["ended", "beendet", "terminata"],
  "link.archive": ["archived", "Archiv", "archivio"],
  "link.cut": [
    "The connection to the run is lost. The page may be out of date; it continues by itself as soon as the server answers.",
    "Die Verbindung zum Lauf ist unterbrochen. Das Gezeigte kann veraltet sein; die Seite macht von selbst weiter, sobald der Server antwortet.",
    "Il collegamento con l'esecuzione è interrotto. I dati possono essere vecchi; la pagina riprende da sola appena il server risponde.",
  ],
  "link.none": [
    "This page could not load its data: {why}. Reload it when the server is running.",
    "Diese Seite bekam ihre Daten nicht: {why}. Neu laden, sobald der Server da ist.",
    "Questa pagina non ha ricevuto i suoi dati: {why}. Ricaricarla quando il server è attivo.",
  ],
  "link.gone": [
    "The runner has ended without finishing the run.",
    "Der Lauf ist abgebrochen: Das Programm ist fort, ohne ein Ende zu melden.",
    "Il programma è sparito; l'esecuzione non è terminata.",
  ],
  // views
  "view.tests": ["Tests", "Tests", "Prove"],
  "view.measurements": ["Measurements", "Messwerte", "Misure"],
  "view.fixtures": ["Fixtures", "Aufbau", "Allestimento"],
  "view.log": ["Log", "Protokoll", "Registro"],
  "view.environment": ["Environment", "Umgebung", "Ambiente"],
  "view.compare": ["Comparison", "Vergleich", "Confronto"],
  "view.trends": ["Trends", "Verlauf", "Andamento"],
  "view.operator": ["Operator", "Bediener", "Operatore"],
  // list of tests
  "list.filter": ["Filter tests", "Tests filtern", "Filtra le prove"],
  "list.order": ["Order", "Reihenfolge", "Ordine"],
  "list.worst": ["failures first", "Fehler zuerst", "prima i problemi"],
  "list.plan": ["as planned", "wie geplant", "come previsto"],
  "list.duration": ["longest first", "längste zuerst", "prima le più lunghe"],
  "list.none": ["No test matches.", "Kein Test passt.", "Nessuna prova corrisponde."],
  "list.empty": ["No tests are planned yet.", "Noch sind keine Tests geplant.", "Nessuna prova ancora prevista."],
  "list.clear": ["Show all tests", "Alle Tests zeigen", "Mostra tutte"],
  "list.select": ["No problems so far.", "Bisher ist nichts auffällig.", "Finora niente da segnalare."],
  "list.back": ["All tests", "Alle Tests", "Tutte le prove"],
  // operator
  "ask.title": ["Question", "Frage", "Domanda"],
  "ask.yes": ["Yes", "Ja", "Sì"],
  "ask.no": ["No", "Nein", "No"],
  "ask.send": ["Send", "Senden", "Invia"],
  "ask.answer": ["Answer", "Antwort", "Risposta"],
  "ask.default": ["then “{answer}” counts", "dann gilt „{answer}“", "poi vale «{answer}»"],
  "ask.nodefault": ["then there is no answer", "dann gibt es keine Antwort", "poi nessuna risposta"],
  "ask.left": ["{time} left", "noch {time}", "restano {time}"],
  "ask.over": ["time is up", "Zeit abgelaufen", "tempo scaduto"],
  "ask.more": ["{n} more questions wait", "{n} weitere Fragen warten", "altre {n} domande in attesa"],
  "ask.sent": ["Sent; waiting for the test.", "Gesendet; wartet auf den Test.", "Inviata; in attesa della prova."],
  "ask.number": ["A number, please.", "Bitte eine Zahl.", "Un numero, per favore."],
  "ask.picture": ["picture for the question", "Bild zur Frage", "immagine per la domanda"],
  "control.off": [
    "This run accepts no answers and no stop from the page.",
    "Dieser Lauf nimmt von der Seite weder Antworten noch Halt an.",
    "Questa esecuzione non accetta risposte né arresto dalla pagina.",
  ],
  "control.token": [
    "To answer or stop, open the page with the complete address that the run printed (it ends in #token=…).",
    "Zum Antworten und Anhalten die Seite mit der ganzen ausgegebenen Adresse öffnen (sie endet mit #token=…).",
    "Per rispondere o fermare, aprire la pagina con l'indirizzo completo stampato all'avvio (termina con #token=…).",
  ],
  "control.archive": ["This is a record of a run.", "Dies ist die Aufzeichnung eines Laufs.", "Questa è la registrazione di un'esecuzione."],
  "stop.button": ["Stop", "Anhalten", "Ferma"],
  "stop.title": ["Stop the run?", "Den Lauf anhalten?", "Fermare l'esecuzione?"],
  "stop.text": [
    "Tests that have not started by then are not run; the fixtures are torn down in order.",
    "Was bis dahin nicht lief, gilt als nicht gelaufen; der Aufbau wird geordnet abgebaut.",
    "Ciò che non è ancora stato eseguito conta come non eseguito; gli allestimenti vengono chiusi in ordine.",
  ],
  "stop.after": ["After this test", "Nach diesem Test", "Dopo questa prova"],
  "stop.now": ["Now", "Sofort", "Subito"],
  "stop.cancel": ["Go on", "Weiterlaufen", "Continua"],
  "sound": ["Sound", "Ton", "Suono"],
  "sound.hint": ["a tone at questions and at the end", "ein Ton bei Fragen und am Ende", "un tono alle domande e alla fine"],
  "help": ["Keys", "Tasten", "Tasti"],
  "close": ["Close", "Schließen", "Chiudi"],
  "key.move": ["next, previous test", "nächster, voriger Test", "prova successiva, precedente"],
  "key.ends": ["first, last", "erster, letzter", "prima, ultima"],
  "key.open": ["open the test", "Test öffnen", "apri la prova"],
  "key.filter": ["filter", "filtern", "filtra"],
  "key.failures": ["failures only, all", "nur Fehler, alle", "solo problemi, tutte"],
  "key.stop": ["stop the run", "Lauf anhalten", "ferma l'esecuzione"],
  "key.back": ["back, clear", "zurück, leeren", "indietro, svuota"],
  "key.help": ["these keys", "diese Tasten", "questi tasti"],
  // announcements of screen readers
  "say.state": ["{name}: {state}", "{name}: {state}", "{name}: {state}"],
  "say.many": ["{n} more tests have failed", "{n} weitere Tests sind fehlgeschlagen", "altre {n} prove fallite"],
  "say.end": ["The run has ended: {state}", "Der Lauf ist zu Ende: {state}", "Esecuzione terminata: {state}"],
};

let column = 0;

/** Choose among the preferred languages, best first; return the chosen one. */
export function chooseLanguage(wanted) {
  const plain = wanted.map((language) => language.toLowerCase().split("-")[0]);
  const language = plain.find((one) => LANGUAGES.includes(one)) ?? LANGUAGES[0];
  column = LANGUAGES.indexOf(language);
  return language;
}

/** Return a text of the page; `{name}` in it is replaced by a value. */
export function t(key, values = {}) {
  const text = WORDS[key]?.[column] ?? key;
  return text.replace(/\{(\w+)\}/g, (whole, name) => values[name] ?? whole);
}

/** Return the word for a state; an unknown state is its own word. */
export function stateWord(state) {
  return t(state);
}
