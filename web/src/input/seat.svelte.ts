// A seat that is driven from this page: reads the devices and sends controls.

import { encodeControl } from '../wire/encode';
import { isHelped } from '../race/helped';
import { Response } from '../race/response';
import type { Visit } from '../race/visit.svelte';
import type { KartFrame } from '../wire/frames';
import { type Choice, CHOICES, type Helped, help, type Level } from './assistance';
import { Pad } from './gamepad';
import { type Grip, Hands } from './hands';
import { Keyboard } from './keyboard';
import { Touch } from './touch';
import { NEUTRAL, tyreLock } from './wheel';

const SEND_MS = 1000 / 40;
const KEPT = 'race.help';

export class DrivenSeat {
  grip = $state.raw<Grip>({ device: 'none', wheel: NEUTRAL, isHeld: false });
  responseMs = $state(NaN);
  level = $state<Choice>(keptLevel());
  /** What the assistance does now. */
  does = $state.raw<Helped['does']>(null);
  readonly touch = new Touch();
  private readonly keyboard = new Keyboard((speed) =>
    tyreLock(this.visit.race.briefing?.numbers ?? new Map(), speed),
  );
  private readonly response = new Response();
  private readonly hands = new Hands([this.keyboard, new Pad(), this.touch]);
  private readonly ending = new AbortController();
  private sequence = 0;
  private timer = 0;

  constructor(
    private readonly visit: Visit,
    readonly number: number,
  ) {
    const { signal } = this.ending;
    addEventListener('keydown', (event) => this.press(event), { signal });
    // Capture: a key is up wherever the focus is, and whatever else is held.
    addEventListener('keyup', (event) => this.take(event, false), { signal, capture: true });
    addEventListener('click', freeSpace, { signal });
    addEventListener('blur', () => this.leave(), { signal });
    addEventListener('focus', () => this.hands.comeBack(), { signal });
    addEventListener('pointerdown', () => this.hands.comeBack(), { signal });
    const onVisible = () => (document.hidden ? this.leave() : this.hands.comeBack());
    document.addEventListener('visibilitychange', onVisible, { signal });
    this.timer = window.setInterval(() => this.drive(), SEND_MS);
  }

  /** Selects the next kind of assistance; after the last, none. */
  changeLevel(): void {
    this.level = CHOICES[(CHOICES.indexOf(this.level) + 1) % CHOICES.length]!;
    localStorage.setItem(KEPT, this.level);
  }

  close(): void {
    clearInterval(this.timer);
    this.ending.abort();
  }

  private press(event: KeyboardEvent): void {
    const isTyping = event.target instanceof Element && event.target.closest('input, select');
    const isPressing = event.target instanceof HTMLButtonElement && isButtonKey(event.code);
    if (isTyping || isPressing || event.ctrlKey || event.metaKey || event.altKey) return;
    this.hands.comeBack();
    this.take(event, true);
  }

  private take(event: KeyboardEvent, isDown: boolean): void {
    if (this.keyboard.take(event.code, isDown, performance.now())) event.preventDefault();
  }

  private leave(): void {
    this.hands.leave(performance.now());
    this.drive();
  }

  private drive(): void {
    const now = performance.now();
    const own = this.visit.race.kart(this.number);
    const wasHeld = this.grip.isHeld;
    this.grip = this.helped(this.hands.read(now, own?.speed ?? 0), own);
    if (own) {
      this.response.noteAcknowledged(own.acknowledged, now);
      this.responseMs = this.response.ms;
    }
    // Once more after the device is released, so that the kart coasts at once. Nothing is sent
    // without a kart on the track: in a lobby, after the end, while others drive.
    if (own && (this.grip.isHeld || wasHeld)) this.send(now);
  }

  private helped(grip: Grip, own: KartFrame | null): Grip {
    const { race } = this.visit;
    const frame = race.buffer.newest;
    if (!grip.isHeld || !own || !frame) {
      this.does = null;
      return grip;
    }
    const situation = { own, frame, flag: race.flagIn(frame), line: race.line };
    const { wheel, does } = help(this.levelAt(own.progress), grip.wheel, situation);
    this.does = does;
    return { ...grip, wheel };
  }

  private levelAt(progress: number): Level {
    if (this.level !== 'fading') return this.level;
    const { course, helped } = this.visit.race;
    return course && isHelped(helped, progress, course.length) ? 'pedals' : 'line';
  }

  private send(now: number): void {
    const frame = this.visit.race.buffer.newest;
    if (!frame) return;
    const { epoch, tick } = frame;
    // A page that was reloaded continues from the server's number.
    const taken = this.visit.race.kart(this.number)?.acknowledged ?? 0;
    const told = this.visit.welcome?.sequence ?? 0;
    const sequence = (this.sequence = Math.max(this.sequence, taken, told) + 1);
    const bytes = encodeControl({ epoch, tick, sequence, ...this.grip.wheel });
    if (this.visit.sendBytes(bytes)) this.response.noteSent(sequence, now);
  }
}

function keptLevel(): Choice {
  const kept = localStorage.getItem(KEPT);
  return CHOICES.find((level) => level === kept) ?? 'line';
}

function isButtonKey(code: string): boolean {
  return code === 'Space' || code === 'Enter';
}

/** Takes the focus from a button that was pressed: the space bar is a brake. */
function freeSpace({ target }: Event): void {
  if (target instanceof Element) target.closest('button')?.blur();
}
