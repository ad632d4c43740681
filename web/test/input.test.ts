import { expect, test } from 'vitest';

import { Pad, type PadState } from '../src/input/gamepad';
import { Hands } from '../src/input/hands';
import { Keyboard } from '../src/input/keyboard';
import { Touch } from '../src/input/touch';
import { pedals, tyreLock } from '../src/input/wheel';

function padState(steering: number, go = 0, index = 0): PadState {
  const buttons = Array.from({ length: 16 }, () => ({ value: 0, pressed: false }));
  buttons[7] = { value: go, pressed: go > 0 };
  return { index, axes: [steering], buttons };
}

test('a key turns the wheel at the speed of a hand, and left is positive', () => {
  const keyboard = new Keyboard();
  keyboard.take('ArrowLeft', true, 0);
  keyboard.read(0, 5);
  expect(keyboard.read(140, 5).steering).toBeCloseTo(0.5);
  expect(keyboard.read(1000, 5).steering).toBe(1);
  keyboard.take('ArrowLeft', false, 1000);
  expect(keyboard.read(1200, 5).steering).toBe(0);
});

test('keys of others are left alone', () => {
  expect(new Keyboard().take('KeyQ', true, 0)).toBe(false);
});

test('a short press of the item key is not lost between two messages', () => {
  const keyboard = new Keyboard();
  keyboard.take('KeyE', true, 0);
  keyboard.take('KeyE', false, 5);
  expect(keyboard.read(20, 5).buttons).toBe(1);
  expect(keyboard.read(300, 5).buttons).toBe(0);
});

test('braking turns into reverse once the kart stands', () => {
  expect(pedals(0, 1, 5)).toEqual({ throttle: 0, brake: 1 });
  expect(pedals(0, 1, 0).throttle).toBeLessThan(0);
  expect(pedals(1, 1, 5).throttle).toBe(0);
});

test('the device that was moved last drives', () => {
  let pad: PadState | null = padState(0);
  const keyboard = new Keyboard();
  const hands = new Hands([keyboard, new Pad(() => (pad ? [pad] : []))]);
  expect(hands.read(0, 0)).toMatchObject({ device: 'none', isHeld: false });
  keyboard.take('ArrowUp', true, 10);
  expect(hands.read(20, 0)).toMatchObject({ device: 'keyboard', isHeld: true });
  pad = padState(-1, 1);
  expect(hands.read(30, 0)).toMatchObject({ device: 'gamepad', isHeld: true });
  expect(hands.read(40, 0).wheel.steering).toBe(1);
});

test('nobody drives when the gamepad that drove is unplugged', () => {
  let pad: PadState | null = padState(0);
  const hands = new Hands([new Pad(() => (pad ? [pad] : []))]);
  hands.read(0, 0);
  pad = padState(0, 1);
  expect(hands.read(10, 0).isHeld).toBe(true);
  pad = null;
  expect(hands.read(20, 0)).toMatchObject({ isHeld: false, wheel: { throttle: 0 } });
});

test('nobody drives while the page is away, nor before something is moved again', () => {
  const keyboard = new Keyboard();
  const hands = new Hands([keyboard]);
  keyboard.take('ArrowUp', true, 0);
  hands.read(0, 0);
  expect(hands.read(200, 0).wheel.throttle).toBe(1);
  hands.leave(300);
  expect(hands.read(310, 0)).toMatchObject({ isHeld: false, wheel: { throttle: 0 } });
  hands.comeBack();
  expect(hands.read(320, 0).isHeld).toBe(false);
  keyboard.take('ArrowUp', true, 400);
  expect(hands.read(410, 0).isHeld).toBe(true);
});

test('a thumb steers from where it came down', () => {
  const touch = new Touch();
  touch.steer(300, 0);
  touch.steer(260, 10);
  touch.pedal('go', 1, 20);
  expect(touch.read(30, 5)).toMatchObject({ steering: 0.5, throttle: 1 });
  touch.steer(null, 40);
  expect(touch.read(50, 5).steering).toBe(0);
});

test('keys turn the wheel no further than the tyres hold', () => {
  const kart = new Map([
    ['front_axle', 0.65],
    ['rear_axle', 0.44],
    ['grip', 0.9],
    ['steering_limit', 0.55],
  ]);
  expect(tyreLock(kart, 1)).toBe(1);
  // 8.8 m/s² at 13 m/s is a radius of 19 m: 0.057 rad of 0.55, and a quarter more.
  expect(tyreLock(kart, 13)).toBeCloseTo((1.25 * 0.057) / 0.55, 2);
  expect(tyreLock(new Map(), 13)).toBe(1); // nothing is known of the vehicle
  const keyboard = new Keyboard((speed) => tyreLock(kart, speed));
  keyboard.take('KeyD', true, 0);
  keyboard.read(0, 13);
  expect(keyboard.read(500, 13).steering).toBeCloseTo(-tyreLock(kart, 13));
});

test('of two gamepads the one that was moved last drives, and no other takes its place', () => {
  let pads = [padState(0), padState(0, 0, 1)];
  const hands = new Hands([new Pad(() => pads)]);
  hands.read(0, 5);
  pads = [padState(0), padState(0, 1, 1)];
  expect(hands.read(10, 5)).toMatchObject({ isHeld: true, wheel: { throttle: 1 } });
  pads = [padState(-1), padState(0, 1, 1)];
  expect(hands.read(20, 5).wheel).toMatchObject({ steering: 1, throttle: 0 });
  pads = [padState(0, 1, 1)];
  expect(hands.read(30, 5).isHeld).toBe(false);
});
