// The race as things in space: x east, y north, z up [m]. What it is seen with is not its matter.

import { Group } from 'three';

import type { Course } from '../race/course';
import type { ReferenceLine } from '../race/line';
import type { KartBody, Race } from '../race/race.svelte';
import { TICKS_PER_SECOND } from '../race/clock';
import type { SnapshotFrame } from '../wire/frames';
import { Badges } from './badges';
import { Barriers } from './barriers';
import { Crowd } from './crowd';
import { Effects } from './effects';
import { Fleet } from './fleet';
import { Gantry } from './gantry';
import { Ground } from './ground';
import { Guide } from './guide';
import { Marks } from './marks';
import { Pickups } from './pickups';
import { Scenery } from './scenery';
import { settingOf } from './surroundings';

/** What is shown of a race, besides what is always there. */
export interface Shown {
  line: boolean;
  names: boolean;
  within: number; // seat that the eye is in, -1 for none
}

// Trees have a size that fits karts and cars, not their models.
const TREES_FROM = 1; // [m], length of a kart

interface Disposable {
  dispose(): void;
}

/** One course and all that is on it. Made again for another course, line or body. */
export class World {
  readonly group = new Group();
  readonly still = new Group(); // what exists: ground, borders, what stands around
  readonly around = new Group(); // of what exists, what lies beyond the borders
  readonly fleet: Fleet;
  readonly badges: Badges;
  readonly guide: Guide | null;
  readonly pickups: Pickups;
  readonly effects: Effects;
  private readonly gantry: Gantry | null;
  private readonly crowd: Crowd;
  private readonly parts: Disposable[] = [];

  constructor(
    readonly course: Course,
    readonly line: ReferenceLine | null,
    readonly body: KartBody,
    readonly places: number,
  ) {
    const { length, width } = body;
    this.group.add(this.still);
    this.still.add(this.around);
    const ground = this.onGround(new Ground(course, length));
    this.around.add(ground.around);
    this.onGround(new Marks(course, line, places, length, width));
    const barriers = this.keep(new Barriers(course, length));
    this.still.add(barriers.mesh);
    if (settingOf(course) === 'outdoor' && length > TREES_FROM) {
      const scenery = this.keep(new Scenery(course));
      this.around.add(scenery.mesh);
    }
    this.gantry = course.isLot ? null : this.onGround(new Gantry(course, length));
    this.guide = line && this.keep(new Guide(line, length));
    this.pickups = this.keep(new Pickups(course, length));
    this.crowd = this.keep(new Crowd(length));
    this.fleet = this.keep(new Fleet(body));
    this.effects = this.keep(new Effects(body));
    this.badges = this.keep(new Badges(length));
    if (this.guide) this.group.add(this.guide.mesh);
    this.group.add(
      this.pickups.group,
      this.crowd.group,
      this.fleet.group,
      this.effects.group,
      this.badges.mesh,
    );
  }

  fits(race: Race, places: number): boolean {
    return (
      race.course === this.course &&
      race.line === this.line &&
      race.body.length === this.body.length &&
      places === this.places
    );
  }

  update(frame: SnapshotFrame, race: Race, shown: Shown): void {
    // What moves by itself follows the time of the race: the same moment, the same picture.
    const clock = frame.tick / TICKS_PER_SECOND;
    this.fleet.update(frame, shown.within);
    this.pickups.update(frame, clock);
    this.crowd.update(frame, race.lot);
    const pulse = race.items.indexOf('pulse') + 1;
    this.effects.update(frame, race.news.events, pulse, clock);
    this.badges.update(frame, race, shown.within, shown.names);
    if (this.guide) this.guide.mesh.visible = shown.line;
    const start = race.standings?.startTick ?? 0;
    this.gantry?.update(frame, (frame.tick - start) / TICKS_PER_SECOND);
  }

  dispose(): void {
    for (const part of this.parts) part.dispose();
  }

  private onGround<P extends Disposable & { group: Group }>(part: P): P {
    this.still.add(part.group);
    return this.keep(part);
  }

  private keep<P extends Disposable>(part: P): P {
    this.parts.push(part);
    return part;
  }
}
