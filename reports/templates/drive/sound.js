// The sound of engine, tyres and wind, made by oscillators and noise.

const FIRING = 4; // ignitions in a turn of the crankshaft
const SQUEAL_RAD = [0.07, 0.16]; // slip angles at which tyres begin to be heard, and are loudest
const SETTLE_S = 0.04;

export function newSound() {
  function begin() {
    const audio = new AudioContext();
    const master = audio.createGain();
    master.gain.value = 0;
    master.connect(audio.destination);
    const filter = audio.createBiquadFilter();
    filter.type = "lowpass";
    const engine = audio.createGain();
    const tones = [1, 0.5, 1.01].map((ratio) => {
      const tone = audio.createOscillator();
      tone.type = ratio === 0.5 ? "square" : "sawtooth";
      tone.connect(filter);
      tone.start();
      return { tone, ratio };
    });
    filter.connect(engine).connect(master);
    const noise = audio.createBuffer(1, audio.sampleRate, audio.sampleRate);
    const samples = noise.getChannelData(0);
    for (let i = 0; i < samples.length; i++) samples[i] = Math.random() * 2 - 1;
    /** @type {(type: BiquadFilterType, frequency: number, q: number) => GainNode} */
    const hiss = (type, frequency, q) => {
      const [source, band, gain] = [audio.createBufferSource(), audio.createBiquadFilter(), audio.createGain()];
      [source.buffer, source.loop, band.type, band.frequency.value, band.Q.value, gain.gain.value] = [noise, true, type, frequency, q, 0];
      source.connect(band).connect(gain).connect(master);
      source.start();
      return gain;
    };
    return { audio, master, filter, engine, tones, squeal: hiss("bandpass", 950, 5), wind: hiss("lowpass", 500, 0.5), grass: hiss("lowpass", 160, 0.7) };
  }
  /** @type {ReturnType<typeof begin> | null} */
  let parts = null;
  return {
    // A browser makes no sound before the person has done something on the page.
    begin() {
      parts ??= begin();
      parts.audio.resume();
    },
    /**
     * @param {import("./link.js").Frame} frame
     * @param {number} own
     * @param {boolean} on
     */
    play(frame, own, on) {
      if (!parts) return;
      const { audio, master, filter, engine, tones, squeal, wind, grass } = parts;
      const car = frame.cars[own];
      /** @type {(param: AudioParam, value: number) => void} */
      const set = (param, value) => param.setTargetAtTime(value, audio.currentTime, SETTLE_S);
      const rpm = Math.max(frame.rpm, 1300);
      for (const { tone, ratio } of tones) set(tone.frequency, (rpm / 60) * FIRING * ratio);
      set(filter.frequency, 300 + rpm * (0.08 + 0.2 * car.throttle));
      set(engine.gain, 0.05 + 0.09 * car.throttle);
      const [from, to] = SQUEAL_RAD;
      const sliding = Math.min(Math.max((frame.sliding - from) / (to - from), 0), 1);
      set(squeal.gain, car.speed > 4 && !frame.offCourse ? 0.22 * sliding : 0);
      set(wind.gain, 0.12 * Math.min(car.speed / 80, 1) ** 2);
      set(grass.gain, frame.offCourse && car.speed > 2 ? 0.5 : 0);
      set(master.gain, on && frame.phase === "racing" ? 0.7 : 0);
    },
  };
}
