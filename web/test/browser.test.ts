import { afterEach, expect, test, vi } from 'vitest';

import { canFillScreen, copyText } from '../src/parts/browser';

const CODE = { innerText: 'race demonstrate' } as HTMLElement;

afterEach(() => vi.unstubAllGlobals());

test('a text is copied where the page has a clipboard', async () => {
  const writeText = vi.fn(() => Promise.resolve());
  vi.stubGlobal('navigator', { clipboard: { writeText } });
  expect(await copyText(CODE)).toBe(true);
  expect(writeText).toHaveBeenCalledWith('race demonstrate');
});

test('a page without https, which has no clipboard, selects the text', async () => {
  const selectAllChildren = vi.fn();
  vi.stubGlobal('navigator', {});
  vi.stubGlobal('getSelection', () => ({ selectAllChildren }));
  expect(await copyText(CODE)).toBe(false);
  expect(selectAllChildren).toHaveBeenCalledWith(CODE);
});

test('a browser that lets no page fill the screen shows no button for it', () => {
  vi.stubGlobal('document', {});
  expect(canFillScreen()).toBe(false);
  vi.stubGlobal('document', { fullscreenEnabled: true });
  expect(canFillScreen()).toBe(true);
});
