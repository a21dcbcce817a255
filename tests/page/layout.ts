// Measures views on screens of tablets: that nothing lies beside the screen, that fingers hit what they aim at, that playback stays in reach.
import type { Page } from 'playwright-core';
import { expect } from 'vitest';
import { keepPicture, type Visitor } from './kit';

export interface Screen {
  width: number;
  height: number;
}

/** Upright and on its side; the least is a narrow window beside another. */
export const kScreens: readonly Screen[] = [
  { width: 600, height: 960 },
  { width: 768, height: 1024 },
  { width: 820, height: 1180 },
  { width: 1024, height: 1366 },
  { width: 1024, height: 768 },
];
/** Of which pictures are kept. */
const kPictured: readonly Screen[] = [
  { width: 820, height: 1180 },
  { width: 1024, height: 768 },
];
/** Up to this width the page is laid out for tablets with a mouse, too. */
const kNarrow = 900;

/** What is smaller than a finger, and why it may be. */
const kSmall: readonly { selector: string; why: string }[] = [
  { selector: '.step-flag', why: 'as wide as the moment it stands on; 44 pixels around it take the finger, and the list of steps has buttons for the same' },
  { selector: '.pick-mark', why: 'its middle is the point that was picked; 44 pixels around it take the finger' },
  { selector: '.cut-handle', why: 'its middle is a place on the organ; 44 pixels around it take the finger' },
  { selector: '.chain-link', why: 'a part of a drawing, which is wider than 44 pixels wherever it can be chosen' },
];

export interface Measured {
  /** By how many pixels the page is wider than the screen. */
  sideways: number;
  /** What reaches beyond the right edge, where it does. */
  beyond: string[];
  /** Targets that are less than 44 pixels wide or high. */
  small: string[];
  /** Parts of playback that are not on the screen, or lie below something else. */
  outOfReach: string[];
}

export async function measured(page: Page, fingers: boolean): Promise<Measured> {
  return page.evaluate(
    ({ fingers, exceptions }) => {
      const kFinger = 44;
      const kRounding = 0.6;
      const named = (one: Element) => {
        const { width, height } = one.getBoundingClientRect();
        const text = (one.getAttribute('aria-label') ?? one.textContent ?? '').trim().slice(0, 30);
        return `${one.tagName.toLowerCase()}.${[...one.classList].join('.')} "${text}" ${Math.round(width)}×${Math.round(height)}`;
      };
      const isShown = (one: Element) => {
        const { width, height, right, bottom } = one.getBoundingClientRect();
        return one.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && width > 1 && height > 1 && right > 0 && bottom > 0;
      };
      const modal = document.querySelector('dialog[open]');
      const root: ParentNode = modal ?? document;
      const scrolling = document.scrollingElement as Element;
      const sideways = Math.max(0, scrolling.scrollWidth - innerWidth);
      const beyond =
        sideways === 0
          ? []
          : [...document.querySelectorAll('body *')]
              .filter((one) => isShown(one) && one.getBoundingClientRect().right > innerWidth + 1)
              .slice(0, 5)
              .map(named);

      // What is pressed for a box to tick, or a file to choose, is its label.
      const targetOf = (one: Element) => (one.matches('input[type=checkbox], input[type=radio], input[type=file]') ? (one.closest('label') ?? one) : one);
      const targets = new Set(
        [...root.querySelectorAll('button, a[href], input, select, textarea, summary, [role=slider], [role=tab]')]
          .filter((one) => !one.closest('[inert]') && !exceptions.some((selector) => one.matches(selector)))
          .map(targetOf)
          .filter(isShown),
      );
      const small = !fingers
        ? []
        : [...targets]
            .filter((one) => {
              const { width, height } = one.getBoundingClientRect();
              return width < kFinger - kRounding || height < kFinger - kRounding;
            })
            .map(named);

      const outOfReach: string[] = [];
      if (!modal && document.querySelector('.controls')) {
        for (const part of document.querySelectorAll('.transport button:not(.touch-only), .transport select, .overview')) {
          const { left, right, top, bottom } = part.getBoundingClientRect();
          const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
          const isInside = left >= 0 && top >= 0 && right <= innerWidth + kRounding && bottom <= innerHeight + kRounding;
          if (!isInside || !(hit && (part.contains(hit) || hit.contains(part)))) outOfReach.push(named(part));
        }
      }
      return { sideways, beyond, small, outOfReach };
    },
    { fingers, exceptions: kSmall.map((one) => one.selector) },
  );
}

const drawn = (page: Page) => page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));

/**
 * Looks at the view that is open on each screen, as a tablet shows it where the browser can be told so (Chromium), and leaves it as a desktop shows it.
 * `atEach`: what else is to be found there.
 */
export async function expectFits({ page, context }: Visitor, view: string, atEach?: (screen: Screen) => Promise<void>): Promise<void> {
  const before = page.viewportSize();
  const isChromium = context.browser()?.browserType().name() === 'chromium';
  const device = isChromium ? await context.newCDPSession(page) : undefined;
  await device?.send('Emulation.setTouchEmulationEnabled', { enabled: true, maxTouchPoints: 5 });
  try {
    for (const screen of kScreens) {
      await page.setViewportSize(screen);
      await drawn(page);
      const coarse = await page.evaluate(() => matchMedia('(pointer: coarse)').matches);
      expect(coarse).toBe(isChromium);
      if (kPictured.some((one) => one.width === screen.width && one.height === screen.height)) {
        await keepPicture(page, `tablet-${view}-${screen.width}`);
      }
      const fingers = coarse || screen.width <= kNarrow;
      // What a view loads, or says for a moment, may move or cover its controls: it is asked until it is at rest.
      await expect
        .poll(async () => ({ view, ...screen, ...(await measured(page, fingers)) }))
        .toEqual({ view, ...screen, sideways: 0, beyond: [], small: [], outOfReach: [] });
      await atEach?.(screen);
    }
  } finally {
    await device?.send('Emulation.setTouchEmulationEnabled', { enabled: false });
    await device?.detach();
    if (before) await page.setViewportSize(before);
  }
}
