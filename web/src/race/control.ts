// Race control: events as sentences.

import type { EventFrame } from '../wire/frames';
import { EventKind, Retirement } from '../wire/tables';
import { clockText, lapText, secondsText } from '../i18n/figures';
import type { Words } from '../i18n/en';
import { type ToldAlert, doingOf, reasonOf, toneOf as toneOfAlert } from './alerts';

export type Tone = 'plain' | 'good' | 'warning' | 'danger';

export interface Message {
  sequence: number;
  tick: number;
  at: string; // race clock
  tone: Tone;
  text: string;
  seat: number; // that it concerns, -1 for all
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

const UNTOLD = new Set<number>([EventKind.SECTOR, EventKind.EFFECT_END, EventKind.PHASE]);

const TONES = new Map<number, Tone>([
  [EventKind.GREEN, 'good'],
  [EventKind.FINISH, 'good'],
  [EventKind.RETIRED, 'danger'],
  [EventKind.HIT, 'warning'],
  [EventKind.FALSE_START, 'danger'],
  [EventKind.SHORT_CUT, 'warning'],
  [EventKind.WRONG_WAY, 'warning'],
  [EventKind.STUCK, 'warning'],
  [EventKind.PENALTY, 'danger'],
  [EventKind.WARNING, 'danger'],
  [EventKind.PARKED, 'good'],
  [EventKind.HIT_PERSON, 'danger'],
]);

/** Returns an event as a message, null for one that is not shown. */
export function messageOf(event: EventFrame, cast: Cast, words: Words): Message | null {
  if (UNTOLD.has(event.kind)) return null;
  const text = textOf(event, cast, words);
  if (!text) return null;
  return {
    sequence: event.sequence,
    tick: event.tick,
    at: clockText((event.tick - cast.startTick) / 60),
    tone: toneOf(event),
    text,
    seat: event.kart,
  };
}

/** Returns what a real kart said as a message. */
export function messageOfAlert({ tick, number, alert }: ToldAlert, cast: Cast, words: Words): Message {
  const who = cast.name(alert.seat);
  return {
    sequence: number,
    tick,
    at: clockText((tick - cast.startTick) / 60),
    tone: toneOfAlert(alert),
    text: words.kartAlerts.told(who, doingOf(alert, words), reasonOf(alert, words)),
    seat: alert.seat,
  };
}

function toneOf(event: EventFrame): Tone {
  if (event.kind === EventKind.FLAG) return (['good', 'warning', 'danger'] as const)[event.other]!;
  return TONES.get(event.kind) ?? 'plain';
}

function textOf(event: EventFrame, cast: Cast, words: Words): string {
  const say = words.events;
  const who = cast.name(event.kart);
  const other = event.other >= 0 ? cast.name(event.other) : words.nobody;
  switch (event.kind) {
    case EventKind.GREEN:
      return say.green;
    case EventKind.LAP:
      return say.lap(who, event.other, lapText(event.value));
    case EventKind.FINISH:
      return say.finish(who);
    case EventKind.RETIRED:
      return say.retired(who, outText(event.other, event.value, words));
    case EventKind.PICK_UP:
      return say.pickUp(who, cast.item(event.other));
    case EventKind.USE:
      return say.use(who, cast.item(event.other));
    case EventKind.HIT:
      return say.hit(who, cast.item(event.value), other);
    case EventKind.BLOCKED_HIT:
      return say.blockedHit(who, cast.item(event.value), other);
    case EventKind.CONTACT_KART:
      return say.contactKart(who, other);
    case EventKind.FALSE_START:
      return say.falseStart(who);
    case EventKind.SHORT_CUT:
      return say.shortCut(who, event.other);
    case EventKind.WRONG_WAY:
      return event.value ? say.wrongWay(who) : '';
    case EventKind.OFF_TRACK:
      return event.value ? say.offTrack(who) : '';
    case EventKind.STUCK:
      return say.stuck(who);
    case EventKind.RESCUED:
      return say.rescued(who);
    case EventKind.PENALTY:
      return event.value < 0
        ? say.takenBack(who, secondsText(-event.value))
        : say.penalty(who, secondsText(event.value));
    case EventKind.FLAG:
      return event.kart >= 0
        ? say.flagAround(words.flags[event.other] ?? '', who)
        : say.flag(words.flags[event.other] ?? '');
    case EventKind.RACE_OVER:
      return say.raceOver;
    case EventKind.WARNING:
      return say.warning(who, other);
    case EventKind.POSE:
      return say.pose(who, words.trusts[event.other] ?? '', words.poseFaults[event.value] ?? '');
    case EventKind.PARKED:
      return say.parked(who, event.other);
    case EventKind.HIT_PERSON:
      return say.hitPerson(who);
    default:
      return '';
  }
}

/** Returns why a kart is out; of one that stewards removed also for what. */
function outText(reason: number, fault: number, words: Words): string {
  const text = words.retirements[reason] ?? words.unknown;
  return reason === Retirement.REMOVED ? `${text}: ${words.faults[fault] ?? ''}` : text;
}
