// Takes a seat through `race gateway` and drives a race: npm start "ADDRESS"

import { Builder, ByteBuffer } from 'flatbuffers';
import WebSocket from 'ws';

import { Button, EventKind, KartFlag, Phase, Status } from '../../web/src/wire/generated/codes.js';
import { Control, ControlMessage, Hud } from '../../web/src/wire/generated/drive.js';
import { Briefing, Course, Line } from '../../web/src/wire/generated/session.js';
import { Events, Snapshot, Standings } from '../../web/src/wire/generated/spectate.js';
import { Pursuit, STAND, type Wishes } from './pursuit.js';

const SNAPSHOTS_HZ = 60; // each is answered with a control
const PRESS_TICKS = 6; // a button acts when it goes down, so it is pressed and released in turn

class Driver {
  #seat = -1;
  #sequence = 0;
  #epoch = -1; // of this kart's race, once it has begun
  #course: Course | undefined;
  #line: Line | undefined;
  #hud: Hud | undefined;
  #pursuit: Pursuit | undefined;

  constructor(readonly socket: WebSocket) {}

  receiveText(words: Record<string, unknown>): void {
    if (words.type === 'welcome') {
      this.#seat = Number(words.seat);
      this.#sequence = Number(words.sequence);
      console.log(`seat ${this.#seat} of session ${words.session}`);
    } else if (words.type === 'ready' && !words.accepted) {
      this.fail(`not accepted as ready: ${words.reason}`);
    } else if (words.type === 'refused') {
      this.fail(`refused: ${words.reason}`);
    } else if (words.type === 'notice' && words.reason) {
      console.log(words.reason);
    }
  }

  receiveMessage(data: Uint8Array): void {
    const buffer = new ByteBuffer(data);
    switch (Buffer.from(data.subarray(4, 8)).toString()) {
      case 'RCRS':
        this.#course = Course.getRootAsCourse(buffer);
        break;
      case 'RLIN':
        this.#line = Line.getRootAsLine(buffer);
        break;
      case 'RBRF':
        this.#getReady(Briefing.getRootAsBriefing(buffer));
        break;
      case 'RHUD':
        this.#hud = Hud.getRootAsHud(buffer);
        this.#epoch = this.#hud.epoch();
        break;
      case 'RSNP':
        this.#answer(Snapshot.getRootAsSnapshot(buffer));
        break;
      case 'REVT':
        this.#showLaps(Events.getRootAsEvents(buffer));
        break;
      case 'RSTD':
        this.#showResult(Standings.getRootAsStandings(buffer));
    }
  }

  // The briefing comes after course and line.
  #getReady(briefing: Briefing): void {
    if (!this.#course || !this.#line?.xLength()) {
      this.fail('this race has no reference line, and this driver needs one');
      return;
    }
    this.#pursuit = new Pursuit(briefing, this.#course, this.#line);
    const lap = this.#line.lap().toFixed(2);
    console.log(
      `${briefing.laps()} laps of ${this.#course.name()}; the reference line's lap takes ${lap} s`,
    );
    if (this.#line.note()) console.log(this.#line.note());
    this.socket.send(JSON.stringify({ type: 'ready', ready: true }));
  }

  #answer(snapshot: Snapshot): void {
    const karts = Array.from({ length: snapshot.kartsLength() }, (_, i) => snapshot.karts(i)!);
    const kart = karts.find((one) => one.seat() === this.#seat);
    if (!this.#pursuit || !this.#hud || !kart || snapshot.epoch() !== this.#epoch) return;
    const isOn = snapshot.phase() === Phase.RUNNING && snapshot.lights() === 0;
    const wishes = isOn ? this.#pursuit.decide(kart, karts, this.#hud) : STAND;
    const presses = Math.floor(snapshot.tick() / PRESS_TICKS) % 2 === 0;
    let buttons = isOn && presses && this.#hud.item() ? Button.USE_ITEM : 0;
    if (kart.flags() & KartFlag.RESCUE_OFFERED) buttons |= Button.ACCEPT_RESCUE;
    this.#sequence = Math.max(this.#sequence, kart.acknowledged()) + 1;
    this.socket.send(controlMessage(this.#sequence, wishes, buttons));
  }

  #showLaps(events: Events): void {
    if (events.epoch() !== this.#epoch) return;
    for (let index = 0; index < events.eventsLength(); index++) {
      const event = events.events(index)!;
      if (event.kind() === EventKind.LAP && event.kart() === this.#seat)
        console.log(`lap ${event.other()}: ${seconds(event.value())}`);
    }
  }

  #showResult(standings: Standings): void {
    if (standings.epoch() !== this.#epoch) return;
    for (let index = 0; index < standings.rowsLength(); index++) {
      const row = standings.rows(index)!;
      if (row.seat() !== this.#seat) continue;
      const place = `place ${row.rank()} of ${standings.rowsLength()}`;
      if (row.status() === Status.FINISHED)
        this.#end(0, `finished in ${seconds(row.raceTimeUs())}, ${place}`);
      if (row.status() === Status.RETIRED) this.#end(1, `out of the race after ${row.laps()} laps`);
    }
  }

  #end(code: number, words: string): void {
    console.log(words);
    this.#leave(code);
  }

  fail(words: string): void {
    if (process.exitCode === undefined) console.error(`error: ${words}`);
    this.#leave(2);
  }

  #leave(code: number): void {
    process.exitCode ??= code;
    this.socket.removeAllListeners('message');
    this.socket.close();
  }
}

// The gateway sets `epoch` and `tick`.
function controlMessage(sequence: number, wishes: Wishes, buttons: number): Uint8Array {
  const builder = new Builder(128);
  ControlMessage.startControlMessage(builder);
  const { steering, throttle, brake } = wishes;
  const control = Control.createControl(
    builder, 0, sequence, 0, steering, throttle, brake, buttons,
  );
  ControlMessage.addControl(builder, control);
  builder.finish(ControlMessage.endControlMessage(builder), 'RCTL');
  return builder.asUint8Array();
}

function seconds(microseconds: bigint): string {
  return `${(Number(microseconds) / 1e6).toFixed(3)} s`;
}

function main(address: string, name: string): void {
  const [page, words = ''] = address.split('#');
  const token = new URLSearchParams(words).get('token');
  if (!page || !token) {
    console.error('usage: npm start "ADDRESS" [NAME]; pass all of the address, in quotes');
    process.exitCode = 2;
    return;
  }
  const socket = new WebSocket(new URL('ws', page.replace(/^http/, 'ws')), 'race.1');
  const driver = new Driver(socket);
  socket.on('open', () => {
    socket.send(JSON.stringify({ role: 'drive', token, name, rate: SNAPSHOTS_HZ }));
  });
  socket.on('message', (data: Buffer, isBinary: boolean) => {
    if (isBinary) driver.receiveMessage(new Uint8Array(data));
    else driver.receiveText(JSON.parse(data.toString()));
  });
  socket.on('error', (error) => driver.fail(`no gateway at ${page}: ${error.message}`));
  socket.on('close', () => driver.fail('the gateway closed the connection before the race was over'));
}

main(process.argv[2] ?? '', process.argv[3] ?? 'JavaScript');
