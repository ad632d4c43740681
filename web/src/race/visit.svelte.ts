// A visit to the gateway: one connection in one role, and the race that comes through it.

import { SvelteMap } from 'svelte/reactivity';

import { Link, type LinkState } from '../wire/link';
import type { Frame } from '../wire/frames';
import type {
  Acted,
  Hello,
  Notice,
  Position,
  Refused,
  Request,
  Told,
  Welcome,
} from '../wire/protocol';
import { ServerClock } from './clock';
import { Race } from './race.svelte';

export class Visit {
  state = $state<LinkState>('connecting');
  refusal = $state.raw<Refused | null>(null);
  welcome = $state.raw<Welcome | null>(null);
  notice = $state.raw<Notice | null>(null);
  position = $state.raw<Position | null>(null);
  log = $state.raw<readonly string[]>([]);
  roundTripMs = $state(NaN);
  readonly acted = new SvelteMap<number, Acted>();
  readonly race: Race;
  readonly clock = new ServerClock();
  readonly isRecording: boolean;
  private readonly link: Link;

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

  send(request: Request): void {
    this.link.send(request);
  }

  sendBytes(bytes: Uint8Array<ArrayBuffer>): boolean {
    return this.link.sendBytes(bytes);
  }

  /** Goes to another tick of the recording; what was drawn before is forgotten. */
  seek(tick: number): void {
    this.race.buffer.clear();
    this.race.forget();
    this.send({ type: 'seek', tick });
  }

  again(): void {
    this.link.open();
  }

  close(): void {
    this.link.close();
  }

  private take(frame: Frame, arrivedMs: number): void {
    this.race.take(frame, arrivedMs);
  }

  private hear(told: Told, arrivedMs: number): void {
    switch (told.type) {
      case 'welcome':
        this.welcome = told;
        this.notice = null;
        return;
      case 'notice':
        this.notice = told;
        return;
      case 'pong':
        this.clock.note(told.t, arrivedMs, told.server_us);
        this.roundTripMs = arrivedMs - told.t;
        return;
      case 'position':
        this.position = told;
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

function addressOf(place: Location): string {
  const scheme = place.protocol === 'https:' ? 'wss:' : 'ws:';
  return `${scheme}//${place.host}/ws`;
}
