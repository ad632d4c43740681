// A visit to the gateway: one connection in one role, and the race that comes through it.

import { SvelteMap } from 'svelte/reactivity';

import { Phase, Status } from '../wire/tables';
import { Link, type LinkState } from '../wire/link';
import type { Frame } from '../wire/frames';
import type {
  Acted,
  Hello,
  Notice,
  Position,
  ProtestAnswer,
  Refused,
  Request,
  Role,
  Told,
  Welcome,
} from '../wire/protocol';
import { ServerClock } from './clock';
import { callOf } from './programme';
import { Notices } from './notices.svelte';
import { Race } from './race.svelte';

export class Visit {
  state = $state<LinkState>('connecting');
  refusal = $state.raw<Refused | null>(null);
  welcome = $state.raw<Welcome | null>(null);
  position = $state.raw<Position | null>(null);
  log = $state.raw<readonly string[]>([]);
  isReady = $state(false); // of a driver in the lobby
  isParking = $state(false); // the server has the wheel, or takes it after the finish
  protested = $state.raw<ProtestAnswer | null>(null); // the answer to the last protest
  roundTripMs = $state(NaN);
  readonly acted = new SvelteMap<number, Acted>();
  readonly race: Race;
  readonly clock = new ServerClock();
  private readonly notices = new Notices();
  readonly isRecording: boolean;
  private readonly link: Link;
  // What the welcome is for, null until that is known.
  private wasLobby: boolean | null = null;
  private call: string | null = null; // the newest of an event

  constructor(readonly hello: Hello) {
    this.isRecording = hello.source.startsWith('recording:');
    this.race = new Race(this.isRecording);
    this.link = new Link(addressOf(location), hello, {
      onState: (state, refusal) => {
        this.state = state;
        this.refusal = refusal;
      },
      onFrame: (frame, arrivedMs) => this.take(frame, arrivedMs),
      onTold: (told, arrivedMs) => this.hear(told, arrivedMs),
    });
    this.link.open();
  }

  /** What matters most of what the gateway says. */
  get note(): Notice | null {
    const { notices } = this;
    const first = notices.about('race') ?? notices.about('ready') ?? notices.about('use');
    return first ?? (this.isRacing ? notices.about('wheel') : null);
  }

  /** Why the server does not park the vehicle, '' if nothing was refused. */
  get parkRefusal(): string {
    return this.notices.about('park')?.reason ?? '';
  }

  private get isRacing(): boolean {
    const { phase, rows } = this.race.standings ?? {};
    const own = rows?.find(({ seat }) => seat === this.welcome?.seat);
    return phase !== Phase.LOBBY && (own?.status ?? Status.RACING) === Status.RACING;
  }

  send(request: Request): void {
    this.link.send(request);
  }

  sendBytes(bytes: Uint8Array<ArrayBuffer>): boolean {
    return this.link.sendBytes(bytes);
  }

  again(): void {
    this.link.open();
  }

  /** Gives the seat up. */
  leave(): void {
    this.link.leave();
  }

  close(): void {
    this.notices.clear();
    this.link.close();
  }

  private take(frame: Frame, arrivedMs: number): void {
    // A steward may have a vehicle parked, and the wheel comes back from a parking driver that fails.
    const wasLed = this.race.hud?.isLed ?? false;
    if (frame.kind === 'hud' && frame.isLed !== wasLed) this.isParking = frame.isLed;
    this.race.take(frame, arrivedMs);
    if (frame.kind === 'standings') this.noteLobby(frame.phase === Phase.LOBBY);
    if (frame.kind === 'programme') this.noteCall(callOf(frame));
  }

  /** Readiness for one race does not count for the next. */
  private noteLobby(isLobby: boolean): void {
    if (this.wasLobby === false && isLobby) [this.isReady, this.isParking] = [false, false];
    this.wasLobby = isLobby;
  }

  /** In an event each call asks for readiness. */
  private noteCall(call: string): void {
    if (this.call !== null && call && call !== this.call) this.isReady = false;
    this.call = call || (this.call ?? '');
  }

  /** Plays a recording from its start; after a break, as it was. */
  private playOn(): void {
    const { tick, playing, speed } = this.position ?? { tick: 0, playing: true, speed: 1 };
    if (tick) this.send({ type: 'seek', tick });
    if (playing) this.send({ type: 'play', speed });
  }

  private hear(told: Told, arrivedMs: number): void {
    switch (told.type) {
      case 'welcome':
        this.welcome = told;
        this.notices.clear();
        this.race.forgetEvent(); // one that is on is told again
        [this.isReady, this.isParking] = [told.ready ?? false, told.park ?? false];
        [this.wasLobby, this.call] = [null, null];
        if (told.delay_ms && !isAtTheWheel(told.role)) this.race.buffer.delayMs = told.delay_ms;
        if (this.isRecording) this.playOn();
        return;
      case 'notice':
        if (told.code === 'no-event') this.race.forgetEvent();
        else this.notices.take(told);
        return;
      case 'ready':
        if (told.accepted) this.isReady = told.ready;
        this.notices.takeAnswer('ready', told.reason);
        return;
      case 'park':
        if (told.accepted) this.isParking = told.park;
        this.notices.takeAnswer('park', told.reason);
        return;
      case 'use':
        this.notices.takeAnswer('use', told.reason);
        return;
      case 'protest':
        this.protested = told;
        return;
      case 'pong':
        if (told.server_us) this.clock.note(told.t, arrivedMs, told.server_us);
        this.roundTripMs = arrivedMs - told.t;
        return;
      case 'position':
        this.position = told;
        if (told.sought) this.race.startOver();
        this.race.buffer.setRate(told.playing ? told.speed : 0);
        return;
      case 'acted':
        this.acted.set(told.id, told);
        return;
      case 'log':
        this.log = told.lines;
        return;
      case 'refused':
    }
  }
}

/** Whether a role looks through a driver's eyes: the picture must not be late. */
function isAtTheWheel(role: Role): boolean {
  return role === 'drive' || role === 'companion';
}

function addressOf(place: Location): string {
  const scheme = place.protocol === 'https:' ? 'wss:' : 'ws:';
  return `${scheme}//${place.host}/ws`;
}
