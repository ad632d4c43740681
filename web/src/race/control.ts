// Race control: events as sentences.

import type { EventFrame } from '../wire/frames';
import { EventKind } from '../wire/codes';
import { clockText, lapText, secondsText } from '../words/figures';
import type { Words } from '../words/words.svelte';

export type Tone = 'plain' | 'good' | 'warning' | 'danger';

export interface Message {
  sequence: number;
  at: string; // race clock
  tone: Tone;
  text: string;
  seat: number; // whom it concerns, -1 for everybody
}

export interface Cast {
  name(seat: number): string;
  item(number: number): string;
  startTick: number;
}

/** Returns a driver and its seat within a sentence: a name written from right to left stays a word. */
export function whoOf(driver: string, seat: number): string {
  return driver ? `\u2068${driver}\u2069 ${seat}` : String(seat);
}

const UNTOLD = new Set<number>([EventKind.sector, EventKind.effectEnd, EventKind.phase]);

const TONES = new Map<number, Tone>([
  [EventKind.green, 'good'],
  [EventKind.finish, 'good'],
  [EventKind.retired, 'danger'],
  [EventKind.hit, 'warning'],
  [EventKind.falseStart, 'danger'],
  [EventKind.shortCut, 'warning'],
  [EventKind.wrongWay, 'warning'],
  [EventKind.stuck, 'warning'],
  [EventKind.penalty, 'danger'],
  [EventKind.warning, 'danger'],
]);

/** Returns an event as a message, or nothing for what is not worth telling. */
export function messageOf(event: EventFrame, cast: Cast, words: Words): Message | null {
  if (UNTOLD.has(event.kind)) return null;
  const text = textOf(event, cast, words);
  if (!text) return null;
  return {
    sequence: event.sequence,
    at: clockText((event.tick - cast.startTick) / 60),
    tone: toneOf(event),
    text,
    seat: event.kart,
  };
}

function toneOf(event: EventFrame): Tone {
  if (event.kind === EventKind.flag) return (['good', 'warning', 'danger'] as const)[event.other]!;
  return TONES.get(event.kind) ?? 'plain';
}

function textOf(event: EventFrame, cast: Cast, words: Words): string {
  const say = words.events;
  const who = cast.name(event.kart);
  const other = event.other >= 0 ? cast.name(event.other) : words.nobody;
  switch (event.kind) {
    case EventKind.green:
      return say.green;
    case EventKind.lap:
      return say.lap(who, event.other, lapText(event.value));
    case EventKind.finish:
      return say.finish(who);
    case EventKind.retired:
      return say.retired(who, words.retirements[event.other] ?? words.unknown);
    case EventKind.pickUp:
      return say.pickUp(who, cast.item(event.other));
    case EventKind.use:
      return say.use(who, cast.item(event.other));
    case EventKind.hit:
      return say.hit(who, cast.item(event.value), other);
    case EventKind.blockedHit:
      return say.blockedHit(who, cast.item(event.value), other);
    case EventKind.contactKart:
      return say.contactKart(who, other);
    case EventKind.falseStart:
      return say.falseStart(who);
    case EventKind.shortCut:
      return say.shortCut(who, event.other);
    case EventKind.wrongWay:
      return event.value ? say.wrongWay(who) : '';
    case EventKind.offTrack:
      return event.value ? say.offTrack(who) : '';
    case EventKind.stuck:
      return say.stuck(who);
    case EventKind.rescued:
      return say.rescued(who);
    case EventKind.penalty:
      return say.penalty(who, secondsText(event.value));
    case EventKind.flag:
      return event.kart >= 0
        ? say.flagAround(words.flags[event.other] ?? '', who)
        : say.flag(words.flags[event.other] ?? '');
    case EventKind.raceOver:
      return say.raceOver;
    case EventKind.warning:
      return say.warning(who, other);
    case EventKind.pose:
      return say.pose(who, words.trusts[event.other] ?? '', words.doubts[event.value] ?? '');
    default:
      return '';
  }
}
