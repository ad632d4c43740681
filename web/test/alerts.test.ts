import { readFileSync } from 'node:fs';

import { expect, test } from 'vitest';

import { placeOf } from '../src/draw/seen';
import { en } from '../src/i18n/en';
import { fr } from '../src/i18n/fr';
import { HeldAlert, isNews, ownText, reasonOf } from '../src/race/alerts';
import { messageOfAlert } from '../src/race/control';
import { alertsAlone } from '../src/race/danger';
import { Race } from '../src/race/race.svelte';
import { decode } from '../src/wire/decode';
import type { KartAlert } from '../src/wire/frames';
import { Advice, Cause, DangerStage, RayHit } from '../src/wire/tables';
import { kart } from './frames';

function alert(changes: Partial<KartAlert> = {}): KartAlert {
  return {
    seat: 3,
    stage: DangerStage.FULL,
    cause: Cause.OBSTACLE,
    hit: RayHit.PERSON,
    advice: Advice.BRAKE,
    bearing: 0.5,
    distance: 4.5,
    time: 0.75,
    needed: 6.5,
    ...changes,
  };
}

test('what the server encodes is read as it was said', () => {
  const file = new URL('../../tests/net/golden_messages.txt', import.meta.url);
  const row = readFileSync(file, 'utf8')
    .split('\n')
    .find((line) => line.startsWith('alerts '))!;
  const bytes = Uint8Array.from(Buffer.from(row.split(' ')[1]!, 'hex'));
  const { bearing, ...exact } = alert({ bearing: 0.25, cause: Cause.OBSTACLE | Cause.LINK });
  const read = decode(bytes.buffer);
  expect(read).toMatchObject({ kind: 'alerts', tick: 600, karts: [exact] });
  expect(read?.kind === 'alerts' && read.karts[0]!.bearing).toBe(bearing);
});

test('a kart says what it does and why, in both languages', () => {
  expect(ownText(alert(), en)).toBe('Your kart brakes: person 4.5 m on the left');
  expect(ownText(alert(), fr)).toBe('Ton kart freine : personne à 4.5 m à gauche');
  const warns = alert({ stage: DangerStage.WARN, cause: 0, bearing: 0, distance: 21.4 });
  expect(ownText(warns, en)).toBe('Brake: person 21 m ahead');
  expect(ownText(alert({ advice: Advice.WAIT, bearing: -0.5 }), en)).toBe(
    'Your kart waits: person 4.5 m on the right',
  );
  const cast = { name: () => 'Ada 3', item: () => '', startTick: 60 };
  const told = messageOfAlert({ tick: 660, number: -1, alert: alert() }, cast, en);
  expect(told).toMatchObject({ at: '0:10.0', tone: 'danger', seat: 3 });
  expect(told.text).toBe('Ada 3: kart brakes: person 4.5 m on the left');
});

test('what is seen is not the reason where the radio is', () => {
  expect(reasonOf(alert({ cause: Cause.LINK | Cause.LOST }), en)).toBe('no radio, place not known');
});

test('what was told is told again after two seconds, a further stage or another reason at once', () => {
  const warns = alert({ stage: DangerStage.WARN });
  const told = [{ tick: 600, number: -1, alert: warns }];
  expect(isNews(alert({ stage: DangerStage.INFORM }), 610, [])).toBe(false);
  expect(isNews(warns, 600, [])).toBe(true);
  expect(isNews({ ...warns, distance: 4 }, 610, told)).toBe(false);
  expect(isNews(warns, 720, told)).toBe(true);
  expect(isNews(alert(), 610, told)).toBe(true);
  expect(isNews({ ...warns, hit: RayHit.KART }, 610, told)).toBe(true);
  expect(isNews({ ...warns, seat: 4 }, 610, told)).toBe(true);
});

test('what a kart sees is drawn from its front bumper on', () => {
  // A kart 2 m long that faces north: its bumper is a metre north of its middle.
  const body = { length: 2, width: 1, ahead: 0 };
  const at = placeOf(kart({ heading: Math.PI / 2 }), alert({ bearing: 0, distance: 3 }), body);
  expect(at[0]).toBeCloseTo(0);
  expect(at[1]).toBeCloseTo(4);
});

test('a driver has time to read a warning, and sees a more urgent one at once', () => {
  const held = new HeldAlert();
  const warns = alert({ stage: DangerStage.WARN });
  expect(held.take(alert({ stage: DangerStage.INFORM }), 0)).toBeNull();
  expect(held.take(warns, 100)).toBe(warns);
  expect(held.take(null, 800)).toBe(warns);
  const brakes = alert();
  expect(held.take(brakes, 850)).toBe(brakes);
  expect(held.take(warns, 900)).toBe(brakes);
  expect(held.take(null, 1700)).toBeNull();
});

test('what the kart beside the page says counts while it is heard, then what the server told', () => {
  const race = new Race();
  race.take({ kind: 'alerts', tick: 60, karts: [alert({ stage: DangerStage.INFORM })] }, 0);
  race.take({ kind: 'own pose', speed: 10, deviation: 0.1, quality: 1 }, 1000);
  race.take({ kind: 'own alert', alert: alert({ seat: -1 }) }, 1000);
  expect(race.alertOfOwn(3, 1400)?.stage).toBe(DangerStage.FULL);
  expect(race.ownKart.pose(1400)?.speed).toBe(10);
  expect(race.alertOfOwn(3, 1600)?.stage).toBe(DangerStage.INFORM);
  expect(race.ownKart.pose(1600)).toBeNull();
});

test('without a race a driver is told what the kart does, and that nothing comes', () => {
  expect(alertsAlone(DangerStage.FULL, NaN)).toEqual(['kartBrakes', 'link']);
  expect(alertsAlone(DangerStage.NONE, 20)).toEqual([]);
});
