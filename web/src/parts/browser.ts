// What not every browser gives to a page.

/** Copies the text of an element; false where it is only selected, as a page without https must. */
export async function copyText(element: HTMLElement): Promise<boolean> {
  try {
    // On an http page there is no clipboard.
    await navigator.clipboard.writeText(element.innerText);
    return true;
  } catch {
    getSelection()?.selectAllChildren(element);
    return false;
  }
}

/** Whether a page may fill the screen: on a telephone of Apple it may not. */
export function canFillScreen(): boolean {
  return document.fullscreenEnabled ?? false;
}
