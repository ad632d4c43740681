// What kind of place a course is, and the colours that follow from it.

import type { Course } from '../race/course';

export type Setting = 'outdoor' | 'hall';

export interface SurroundingColours {
  around: string;
  verge: string;
  road: string;
  wall: Record<'left' | 'right', readonly [string, string]>; // pieces in turn
}

// Courses of models, whose borders the rules of the 1/10 race ask to be red and green.
const MODEL_LENGTH = 1;

const OUTDOOR: SurroundingColours = {
  around: '#86a860',
  verge: '#97bb6a',
  road: '#71767d',
  wall: { left: ['#e9ecef', '#c8332b'], right: ['#e9ecef', '#2a63b0'] },
};

const HALL: SurroundingColours = {
  around: '#9aa2aa',
  verge: '#a6adb4',
  road: '#7b8088',
  wall: { left: ['#e9ecef', '#c8332b'], right: ['#e9ecef', '#2a63b0'] },
};

const BLOCKS: SurroundingColours = {
  around: '#a2a9b1',
  verge: '#aab1b8',
  road: '#ccd1d6',
  wall: { left: ['#d8352c', '#c62e26'], right: ['#2f9e4f', '#278a44'] },
};

export function hasVerge(course: Course): boolean {
  return course.frame.kerb + course.frame.grass > 0;
}

export function settingOf(course: Course): Setting {
  return hasVerge(course) ? 'outdoor' : 'hall';
}

export function coloursOf(course: Course): SurroundingColours {
  if (hasVerge(course)) return OUTDOOR;
  const { kartLength } = course.frame;
  return kartLength < MODEL_LENGTH && !course.isLot ? BLOCKS : HALL;
}
