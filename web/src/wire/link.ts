// A connection to the gateway that reconnects by itself.

import { decode } from './decode';
import type { Frame } from './frames';
import { type Hello, type Refused, type Request, type Told, isPassing } from './protocol';

export type LinkState = 'connecting' | 'open' | 'waiting' | 'refused' | 'closed';

export interface LinkListener {
  onState(state: LinkState, refusal: Refused | null): void;
  onFrame(frame: Frame, arrivedMs: number): void;
  onTold(told: Told, arrivedMs: number): void;
}

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;
const PING_MS = 2000;
// A gateway answers each ping; where nothing at all comes after this many of them, the link is
// dead. Counted, not timed: a page in the background pings seldom, one that is busy reads late.
const MOST_UNANSWERED = 3;
// It answers none before its welcome, and that takes longer.
const MOST_BEFORE_WELCOME = 12;
// At the last of them the gateway has received nothing on the lost connection for two seconds.
const DRIVER_TRIES = 3;

export class Link {
  private socket: WebSocket | null = null;
  private waits = 0;
  private timer = 0;
  private pinging = 0;
  private unanswered = 0;
  private isWelcome = false;
  private isEnded = false;
  private refusal: Refused | null = null;

  constructor(
    private readonly address: string,
    private readonly hello: Hello,
    private readonly listener: LinkListener,
    private readonly keeper: ResumeKeeper = new ResumeKeeper(hello),
  ) {}

  open(): void {
    this.refusal = null;
    this.listener.onState('connecting', null);
    [this.unanswered, this.isWelcome] = [0, false];
    const socket = new WebSocket(this.address, 'race.1');
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    socket.onopen = () => this.greet(socket);
    socket.onmessage = (message) => this.hear(message.data as ArrayBuffer | string);
    socket.onclose = () => this.lose(socket);
    clearInterval(this.pinging);
    this.pinging = window.setInterval(() => this.ping(socket), PING_MS);
  }

  send(request: Request): void {
    if (this.isOpen) this.socket!.send(JSON.stringify(request));
  }

  /** Sends bytes, unless earlier ones are still queued: an old control is useless. */
  sendBytes(bytes: Uint8Array<ArrayBuffer>): boolean {
    if (!this.isOpen || this.socket!.bufferedAmount > 4 * bytes.byteLength) return false;
    this.socket!.send(bytes);
    return true;
  }

  close(): void {
    this.isEnded = true;
    clearTimeout(this.timer);
    clearInterval(this.pinging);
    this.socket?.close();
    this.listener.onState('closed', null);
  }

  /** Leaves for good: the seat is given up. */
  leave(): void {
    this.send({ type: 'leave' });
    this.keeper.forget();
    this.close();
  }

  private get isOpen(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  private greet(socket: WebSocket): void {
    const resume = this.keeper.take();
    socket.send(JSON.stringify(resume ? { ...this.hello, token: '', resume } : this.hello));
  }

  private ping(socket: WebSocket): void {
    const most = this.isWelcome ? MOST_UNANSWERED : MOST_BEFORE_WELCOME;
    if (++this.unanswered > most) this.drop(socket);
    else this.send({ type: 'ping', t: performance.now() });
  }

  /** Gives up a dead link; where no network is, closing it would take a minute. */
  private drop(socket: WebSocket): void {
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
    this.lose(socket);
  }

  private hear(data: ArrayBuffer | string): void {
    const now = performance.now();
    this.unanswered = 0;
    if (typeof data === 'string') this.take(JSON.parse(data) as Told, now);
    else {
      const frame = decode(data);
      if (frame) this.listener.onFrame(frame, now);
    }
  }

  private take(told: Told, now: number): void {
    if (told.type === 'welcome') {
      this.waits = 0;
      this.isWelcome = true;
      this.keeper.keep(told.resume);
      this.send({ type: 'ping', t: now });
      this.listener.onState('open', null);
    }
    if (told.type === 'refused') this.refusal = told;
    this.listener.onTold(told, now);
  }

  private lose(socket: WebSocket): void {
    if (socket !== this.socket || this.isEnded) return;
    clearInterval(this.pinging);
    const refusal = this.refusal;
    // A resume token that was used: log in with the token. A driver's may only be early: the gateway
    // refuses it while it takes the lost connection for an open one.
    const isStale = refusal?.code === 'used' && this.keeper.hasTaken;
    if (isStale) this.keeper.putBack();
    if (refusal && !isPassing(refusal.code) && !isStale) {
      this.listener.onState('refused', refusal);
      return;
    }
    const wait = Math.min(FIRST_WAIT_MS * 2 ** this.waits++, LONGEST_WAIT_MS);
    this.listener.onState('waiting', refusal);
    this.timer = window.setTimeout(() => this.open(), wait * (0.75 + 0.5 * Math.random()));
  }
}

/** Keeps the single-use token with which a page that is reloaded gets its seat back. */
export class ResumeKeeper {
  hasTaken = false;
  private readonly name: string;
  private readonly most: number; // uses of a token
  private token = '';
  private shown = 0;

  constructor(hello: Hello) {
    // Another driver in the same tab does not come back as the one before.
    const { role, source, seat, name, token } = hello;
    this.name = ['race.resume', role, source, seat, name, token].join('.');
    this.most = hello.role === 'drive' ? DRIVER_TRIES : 1;
  }

  keep(token: string): void {
    this.hasTaken = false;
    this.shown = 0;
    sessionStorage.setItem(this.name, token);
  }

  /** Who leaves does not come back. */
  forget(): void {
    sessionStorage.removeItem(this.name);
  }

  /** Returns the token, once. */
  take(): string {
    this.token = sessionStorage.getItem(this.name) ?? '';
    sessionStorage.removeItem(this.name);
    this.hasTaken = this.token !== '';
    this.shown += Number(this.hasTaken);
    return this.token;
  }

  /** The token was refused: it may be used again, a few times. */
  putBack(): void {
    if (this.shown < this.most) sessionStorage.setItem(this.name, this.token);
  }
}
