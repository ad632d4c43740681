// Plays the sounds of a kart with WebAudio: all of them are made here, none is loaded.

import type { Alert } from '../race/danger';
import type { Race } from '../race/race.svelte';
import { mixOf, type Tone, tonesOfAlerts, tonesOfEvent } from './mix';

const MASTER = 0.35;
const [MOTOR_GAIN, SQUEAL_GAIN, TONE_GAIN] = [0.3, 0.12, 0.25];
// Time constant with which sounds follow the kart [s].
const FOLLOW_S = 0.05;
const NOISE_S = 2;
// Speed that counts as the top until the kart was faster [m/s].
const USUAL_TOP = 8;

export class SoundPlayer {
  private readonly context = new AudioContext();
  private readonly master = this.context.createGain();
  private readonly motor = this.context.createGain();
  private readonly squeal = this.context.createGain();
  private readonly voices: OscillatorNode[] = [];
  private readonly muffler = this.context.createBiquadFilter();
  private heard = 0; // sequence of the newest event
  private alerts: readonly Alert[] = [];
  private top = USUAL_TOP;

  constructor() {
    const { context, master, motor, squeal, muffler } = this;
    master.gain.value = MASTER;
    motor.gain.value = squeal.gain.value = 0;
    muffler.type = 'lowpass';
    for (const [type, detune] of [
      ['sawtooth', 0],
      ['square', -1195],
      ['sawtooth', 9],
    ] as const) {
      const voice = new OscillatorNode(context, { type, detune });
      voice.connect(muffler);
      voice.start();
      this.voices.push(voice);
    }
    muffler.connect(motor).connect(master);
    const noise = new AudioBufferSourceNode(context, { buffer: noiseIn(context), loop: true });
    const band = new BiquadFilterNode(context, { type: 'bandpass', frequency: 1400, Q: 5 });
    noise.connect(band).connect(squeal).connect(master);
    noise.start();
    master.connect(context.destination);
  }

  /** Follows a kart. alerts: that its driver sees now. */
  follow(race: Race, seat: number, alerts: readonly Alert[]): void {
    const kart = race.kart(seat);
    const now = this.context.currentTime;
    this.top = Math.max(this.top, Math.abs(kart?.speed ?? 0));
    const mix = kart ? mixOf(kart, this.top) : { pitch: 40, motor: 0, squeal: 0 };
    for (const voice of this.voices) voice.frequency.setTargetAtTime(mix.pitch, now, FOLLOW_S);
    this.muffler.frequency.setTargetAtTime(350 + 7 * mix.pitch, now, FOLLOW_S);
    this.motor.gain.setTargetAtTime(MOTOR_GAIN * mix.motor, now, FOLLOW_S);
    this.squeal.gain.setTargetAtTime(SQUEAL_GAIN * mix.squeal, now, FOLLOW_S);
    this.tell(race, seat, alerts);
  }

  close(): void {
    void this.context.close();
  }

  private tell(race: Race, seat: number, alerts: readonly Alert[]): void {
    const newest = race.news.events.at(-1)?.sequence ?? 0;
    // Events before the sound was switched on, and those of a race before, are not told.
    if (this.heard > 0 && newest > this.heard) {
      for (const event of race.news.events) {
        if (event.sequence > this.heard) this.play(tonesOfEvent(event, seat));
      }
    }
    this.heard = newest || 1;
    this.play(tonesOfAlerts(this.alerts, alerts));
    this.alerts = alerts;
  }

  private play(tones: readonly Tone[]): void {
    for (const { from, to, seconds, after } of tones) {
      const begin = this.context.currentTime + after;
      const voice = new OscillatorNode(this.context, { type: 'triangle', frequency: from });
      const gain = new GainNode(this.context, { gain: 0 });
      voice.frequency.setValueAtTime(from, begin);
      voice.frequency.exponentialRampToValueAtTime(to, begin + seconds);
      gain.gain.setValueAtTime(TONE_GAIN, begin);
      gain.gain.setTargetAtTime(0, begin + 0.6 * seconds, 0.15 * seconds);
      voice.connect(gain).connect(this.master);
      voice.start(begin);
      voice.stop(begin + 1.6 * seconds);
    }
  }
}

function noiseIn(context: AudioContext): AudioBuffer {
  const buffer = context.createBuffer(1, NOISE_S * context.sampleRate, context.sampleRate);
  const samples = buffer.getChannelData(0);
  for (let i = 0; i < samples.length; i++) samples[i] = 2 * Math.random() - 1;
  return buffer;
}
