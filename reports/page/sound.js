// Tones for the operator: off by default, and remembered.

const SOUND_KEY = "rtf-sound";

export class Sound {
  #context = null;

  constructor() {
    try {
      this.on = localStorage.getItem(SOUND_KEY) === "on";
    } catch {
      this.on = false; // a browser without storage
    }
  }

  turn(on) {
    this.on = on;
    try {
      localStorage.setItem(SOUND_KEY, on ? "on" : "off");
    } catch {
      // the setting lasts as long as the page
    }
    if (on) this.question();
  }

  question() {
    this.#play([660, 880]);
  }

  end(good) {
    this.#play(good ? [523, 659, 784] : [440, 330]);
  }

  #play(tones) {
    if (!this.on) return;
    this.#context ??= new AudioContext();
    this.#context.resume();
    tones.forEach((frequency, index) => this.#tone(frequency, this.#context.currentTime + 0.18 * index));
  }

  #tone(frequency, start) {
    const oscillator = this.#context.createOscillator();
    const gain = this.#context.createGain();
    oscillator.frequency.value = frequency;
    gain.gain.setValueAtTime(0.0001, start);
    gain.gain.exponentialRampToValueAtTime(0.2, start + 0.02);
    gain.gain.exponentialRampToValueAtTime(0.0001, start + 0.16);
    oscillator.connect(gain).connect(this.#context.destination);
    oscillator.start(start);
    oscillator.stop(start + 0.18);
  }
}
