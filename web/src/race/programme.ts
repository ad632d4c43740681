// What people want to know of an event, from its programme.

import type { DeletedLapFrame, ProgrammeFrame, TeamFrame } from '../wire/eventFrames';
import { EventPhase } from '../wire/tables';
import type { Words } from '../i18n/en';

/** Returns the team that is called, or drives, alone; null in races and after the end. */
export function aloneOn(programme: ProgrammeFrame): TeamFrame | null {
  const [name] = programme.now?.teams ?? [];
  if (!programme.attempts || programme.phase > EventPhase.ON_TRACK) return null;
  return programme.teams.find((team) => team.name === name) ?? null;
}

/** Returns what tells a call from all others, also from the same one of a server that was started
    again; '' while nobody is called. */
export function callOf(programme: ProgrammeFrame | null): string {
  if (programme?.phase !== EventPhase.CALLED) return '';
  return `${programme.driven} ${programme.untilMs}`;
}

/** Returns what is called, driven, or was driven last, in the reader's language. */
export function nowText(programme: ProgrammeFrame, words: Words): string {
  const team = aloneOn(programme);
  if (!team) return words.event.heading(programme.now?.title ?? '');
  // Its times hold it, too, once it is over.
  const number = /, attempt (\d+)$/.exec(programme.now?.title ?? '')?.[1];
  const attempt = words.event.attempt(Number(number ?? team.attemptsUs.length + 1), programme.attempts);
  return `${words.event.heading(programme.stage)}, ${attempt}`;
}

/** Returns for how many seconds the call, the review or the attempt goes on, NaN without a limit. */
export function secondsLeft(
  programme: ProgrammeFrame,
  { serverMs, tick, startTick }: { serverMs: number; tick: number; startTick: number },
): number {
  if (programme.phase === EventPhase.ON_TRACK) {
    const driven = Math.max(tick - startTick, 0) / 60;
    return programme.limitS > 0 ? Math.max(programme.limitS - driven, 0) : NaN;
  }
  return programme.untilMs > 0 ? Math.max((programme.untilMs - serverMs) / 1000, 0) : NaN;
}

/** Returns after how many others a team is called, 0 for now; -1 if not again in this stage. */
export function turnsUntil(programme: ProgrammeFrame, seat: number): number {
  const name = programme.teams.find((team) => team.seat === seat)?.name;
  const calls = programme.now ? [programme.now, ...programme.coming] : programme.coming;
  return name === undefined ? -1 : calls.findIndex((call) => call.teams.includes(name));
}

/** Returns why a lap does not count, in the reader's language. */
export function deletedText(lap: DeletedLapFrame, words: Words): string {
  const { deleted, remark } = words.event;
  return deleted(lap.attempt, lap.lap, lap.why.split(', ').map(remark).join(', '));
}

/** Returns the remarks on a team: its laps that do not count, and how its last race ended. */
export function remarksOn(team: TeamFrame, words: Words): string {
  return [...team.deleted.map((lap) => deletedText(lap, words)), words.event.remark(team.remark)]
    .filter(Boolean)
    .join(' · ');
}

/** Returns the first three of an event that is over, none before. */
export function podiumOf(programme: ProgrammeFrame): TeamFrame[] {
  if (programme.driven < programme.drives) return [];
  return programme.teams.filter(({ place }) => place >= 1 && place <= 3);
}
