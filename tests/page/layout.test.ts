// The viewer on a tablet, and where there is nothing to show: every view on every screen, measured; what fingers do on the time line; what the page says
// when there is nothing yet, when nothing is found, when a case is damaged, when the browser lacks a codec, when the server is gone and comes back.
import type { Browser, CDPSession } from 'playwright-core';
import { afterAll, beforeAll, beforeEach, describe, expect, it } from 'vitest';
import { Appliance, clockOf, near, newTab, settled, startBrowser, visit, visitSignedIn, type Visitor } from './kit';
import { expectFits } from './layout';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
let id = '';
let tampered = '';
let damaged = '';

const openCase = async (one: string) => {
  await visitor.page.goto(`${appliance.url}#/cases/${one}`);
  await visitor.page.locator('.timeline').waitFor();
  await settled(visitor.page);
};

beforeAll(async () => {
  appliance = await Appliance.alone();
  const more = ['--vitals', 'synthetic:patient', '--segment', '3s', '--duration', '9s'];
  const source = 'synthetic:pattern?size=480x270';
  for (let i = 0; i < 3; ++i) await appliance.kiroku('record', '--endoscope', source, '--room', `${source}&beep=1`, ...more);
  [id, tampered, damaged] = appliance.cases() as [string, string, string];
  appliance.tamper(tampered, 'endoscope', 1);
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
});
beforeEach(async () => {
  await newTab(visitor);
});
afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

describe('Where there is nothing yet', () => {
  let empty: Appliance;
  beforeAll(async () => {
    empty = await Appliance.alone();
  });
  afterAll(async () => {
    await empty?.stop();
  });

  it('the page says what is the matter and what to do', async () => {
    const stranger = await visit(browser);
    await stranger.page.goto(empty.url);
    await stranger.page.getByRole('heading', { name: 'Sign in' }).waitFor();
    await expectFits(stranger, 'sign-in');
    await stranger.context.close();

    const newcomer = await visitSignedIn(browser, empty);
    const { page } = newcomer;
    const card = page.locator('.state-card');
    await card.getByText('Nothing has been recorded yet.').waitFor();
    await card.getByText('A case appears here as soon as a recording begins').waitFor();
    await expectFits(newcomer, 'no-cases');
    await card.getByRole('link', { name: 'To the rooms' }).click();
    await card.getByText('No recorder is running on this appliance.').waitFor();
    await card.getByText('start kirokud on the recorder').waitFor();
    await expectFits(newcomer, 'no-recorder');
    await page.goto(`${empty.url}#/cases/20200101T000000Z-00000000`);
    await card.getByText('There is no such case here.').waitFor();
    await expectFits(newcomer, 'no-case');
    await card.getByRole('link', { name: 'All cases' }).click();
    await page.getByRole('heading', { name: 'Cases' }).waitFor();
    await newcomer.context.close();
  });
});

describe('A case on a tablet', () => {
  it('stands in a list that scrolls wherever the pointer is', async () => {
    const { page } = visitor;
    await page.goto(`${appliance.url}#/cases`);
    await page.locator('.case-row').nth(2).waitFor();
    await expectFits(visitor, 'cases');
    await page.setViewportSize({ width: 1440, height: 200 });
    for (const x of [10, 720, 1430]) {
      await page.evaluate(() => scrollTo(0, 0));
      await page.mouse.move(x, 120);
      await page.mouse.wheel(0, 150);
      await expect.poll(() => page.evaluate(() => scrollY)).toBeGreaterThan(50);
    }
    await page.setViewportSize({ width: 1440, height: 900 });
    await page.getByPlaceholder('Search').fill('no such case');
    await page.locator('.state-card').getByText('No case matches “no such case”.').waitFor();
    await page.getByRole('button', { name: 'Show all cases' }).click();
    await expect.poll(() => page.locator('.case-row').count()).toBe(3);
  });

  it('shows the endoscope first, with playback in reach, wherever it is scrolled to', async () => {
    const { page } = visitor;
    await openCase(id);
    await expectFits(visitor, 'case', async ({ width, height }) => {
      const places = await page.evaluate(() =>
        [...document.querySelectorAll('.pane')].map((one) => ({
          stream: (one as HTMLElement).dataset['stream'],
          ...(one.getBoundingClientRect().toJSON() as DOMRect),
        })),
      );
      const endoscope = places.find((one) => one.stream === 'endoscope') as DOMRect;
      for (const other of places) expect(endoscope.top).toBeLessThanOrEqual(other.top);
      expect(endoscope.top).toBeGreaterThanOrEqual(0);
      const controls = (await page.locator('.controls').boundingBox()) as { y: number };
      expect(endoscope.bottom).toBeLessThanOrEqual(controls.y + 1);
      if (width <= 900) expect(endoscope.width).toBeGreaterThan(0.95 * width);
      expect(endoscope.height).toBeGreaterThan(0.25 * height);
      // To its end, where the lanes are.
      await page.locator('.case').evaluate((one) => one.scrollTo(0, one.scrollHeight));
      expect(
        await page.locator('.button-play').evaluate((one) => {
          const { left, top, width, height } = one.getBoundingClientRect();
          return one.contains(document.elementFromPoint(left + width / 2, top + height / 2));
        }),
      ).toBe(true);
      const lanes = (await page.locator('.lanes').boundingBox()) as { y: number; height: number };
      expect(lanes.y + 40).toBeLessThan((await page.locator('.controls').boundingBox())?.y as number);
      await page.locator('.case').evaluate((one) => one.scrollTo(0, 0));
    });
  });

  it('has room for fingers in every panel and dialogue', async () => {
    const { page } = visitor;
    await openCase(id);
    await page.keyboard.press('i');
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('o');
    await page.locator('.selection-bar').waitFor();
    await page.getByRole('tab', { name: 'Moments' }).click();
    await expectFits(visitor, 'moments');
    await page.locator('.selection-bar').getByRole('button', { name: 'Export' }).click();
    await page.getByRole('dialog', { name: 'Export' }).waitFor();
    await expectFits(visitor, 'export');
    await page.keyboard.press('Escape');
    await page.keyboard.press('?');
    await page.getByRole('dialog', { name: 'Keys' }).waitFor();
    await expectFits(visitor, 'keys');
    await page.keyboard.press('Escape');
    await page.keyboard.press('Escape');
  });

  it('is verified there, and its appliance log, users and sealed state fit', async () => {
    const { page } = visitor;
    await page.goto(`${appliance.url}#/cases/${tampered}/verification`);
    await page.getByRole('button', { name: 'Verify now' }).click();
    await page.locator('.banner-tampered').waitFor();
    await expectFits(visitor, 'verification');
    await page.goto(`${appliance.url}#/log`);
    await page.locator('.log-table tbody tr').first().waitFor();
    await page.locator('.log-verdict').waitFor();
    await expectFits(visitor, 'log');
    await appliance.addUser('bea', 'operator');
    await page.goto(`${appliance.url}#/users`);
    await page.locator('.table tbody tr').first().waitFor();
    await expectFits(visitor, 'users');
  });
});

describe('Fingers on the time line', () => {
  let touch: CDPSession;
  const finger = async (type: 'touchStart' | 'touchMove' | 'touchEnd', ...points: { x: number; y: number }[]) => {
    await touch.send('Input.dispatchTouchEvent', { type, touchPoints: points.map((point, id) => ({ ...point, id })) });
  };
  const box = async (selector: string) => (await visitor.page.locator(selector).boundingBox()) as { x: number; y: number; width: number; height: number };
  const end = async () => Number(await visitor.page.locator('.overview').getAttribute('aria-valuemax'));

  beforeEach(async () => {
    touch = await visitor.context.newCDPSession(visitor.page);
    await touch.send('Emulation.setTouchEmulationEnabled', { enabled: true, maxTouchPoints: 5 });
    await visitor.page.setViewportSize({ width: 820, height: 1180 });
    await openCase(id);
  });

  it('seek on the bar, by a tap and by a drag', async () => {
    const { page } = visitor;
    const bar = await box('.overview');
    const y = bar.y + bar.height / 2;
    await finger('touchStart', { x: bar.x + bar.width / 2, y });
    await finger('touchEnd');
    await near(page, (await end()) / 2, 0.6);
    await finger('touchStart', { x: bar.x + bar.width / 2, y });
    for (let share = 0.5; share >= 0.25; share -= 0.05) await finger('touchMove', { x: bar.x + bar.width * share, y });
    await finger('touchMove', { x: bar.x + bar.width / 4, y });
    await finger('touchEnd');
    await near(page, (await end()) / 4, 0.6);
  });

  it('scroll by a swipe over the lanes, which moves the clock nowhere', async () => {
    const { page } = visitor;
    const scroller = page.locator('.case');
    await page.setViewportSize({ width: 820, height: 760 });
    await page.locator('.lanes').scrollIntoViewIfNeeded();
    const before = await scroller.evaluate((one) => one.scrollTop);
    expect(before).toBeGreaterThan(100);
    const at = await clockOf(page);
    const lanes = await box('.lanes');
    const x = lanes.x + lanes.width * 0.8;
    const from = Math.max(lanes.y + 20, 120);
    await finger('touchStart', { x, y: from });
    for (let step = 1; step <= 8; ++step) await finger('touchMove', { x, y: from + 12 * step });
    await finger('touchEnd');
    await expect.poll(() => scroller.evaluate((one) => one.scrollTop)).toBeLessThan(before - 30);
    expect(await clockOf(page)).toBe(at);
    await page.setViewportSize({ width: 820, height: 1180 });
  });

  it('look closer with two fingers, and come to a moment with one', async () => {
    const { page } = visitor;
    await page.locator('.lanes').scrollIntoViewIfNeeded();
    const lanes = await box('.lanes');
    const y = lanes.y + 60;
    const at = (share: number) => ({ x: lanes.x + lanes.width * share, y });
    const clock = await clockOf(page);
    await expect.poll(() => page.locator('.overview-window').isVisible()).toBe(false);
    await finger('touchStart', at(0.45), at(0.55));
    for (let step = 1; step <= 6; ++step) await finger('touchMove', at(0.45 - 0.05 * step), at(0.55 + 0.05 * step));
    await finger('touchEnd');
    const bar = await box('.overview');
    await expect.poll(async () => (await box('.overview-window')).width).toBeLessThan(0.3 * bar.width);
    expect(await clockOf(page)).toBe(clock);
    // The middle of the lanes is the middle of the case still.
    await finger('touchStart', at(0.5));
    await finger('touchEnd');
    await near(page, (await end()) / 2, 0.6);
  });
});

describe('A browser that cannot play the video', () => {
  it('says so, says what helps, and shows archived frames all the same', async () => {
    const { page } = visitor;
    // No browser here lacks the codec: this one is told that it does.
    await page.addInitScript(() => {
      MediaSource.isTypeSupported = () => false;
    });
    await page.goto(`${appliance.url}#/cases/${id}`);
    const pane = page.locator('.pane[data-stream=endoscope]');
    await pane.getByText('This browser cannot play the video (H.264).').waitFor();
    await pane.getByText('Use Chromium, Firefox or Safari').waitFor();
    await expectFits(visitor, 'no-codec');
    await page.keyboard.press('a');
    await pane.locator('canvas.pane-original').waitFor();
    // Nothing waits for pictures that never come.
    await page.keyboard.press('Home');
    await page.keyboard.press('Space');
    await expect.poll(() => clockOf(page)).toBeGreaterThan(1);
    await page.keyboard.press('Space');
  });
});

describe('A server that is gone', () => {
  it('is said above every view, asked again, and what lacked is loaded once it is back', async () => {
    const { page } = visitor;
    const unreachable = '**/api/**';
    await page.goto(`${appliance.url}#/cases`);
    await expect.poll(() => page.locator('.case-row').count()).toBe(3);
    await page.route(unreachable, (route) => route.abort('connectionrefused'));
    await page.locator('.case-link', { hasText: id }).click();
    await page.getByText('The server does not answer.').waitFor();
    await page.getByRole('button', { name: 'Try now' }).click();
    await expectFits(visitor, 'gone');
    // By itself, without a click.
    await page.unroute(unreachable);
    await page.locator('.timeline').waitFor();
    await expect.poll(() => page.locator('.gone').count()).toBe(0);
  });

  it('that began anew asks to sign in, and leads back to where one was', async () => {
    const { page } = visitor;
    // As after the server was away: the page has asked for it again.
    await page.goto(`${appliance.url}#/cases`);
    await page.locator('.case-row').first().waitFor();
    await page.route('**/api/**', (route) => route.abort('connectionrefused'));
    await page.locator('.case-link', { hasText: id }).click();
    await page.getByText('The server does not answer.').waitFor();
    await page.unroute('**/api/**');
    await page.locator('.timeline').waitFor();
    await settled(page);
    await page.keyboard.press('ArrowRight');
    await near(page, 5);
    await appliance.addUser('anna', 'administrator');
    await appliance.restartView();
    // The page notices with the next thing it asks for.
    await page.keyboard.press('a');
    await page.getByText('Your session has ended.').waitFor();
    await expectFits(visitor, 'session-ended');
    await page.getByLabel('Name').fill('anna');
    await page.getByLabel('Password').fill(appliance.password);
    await page.keyboard.press('Enter');
    await page.locator('.timeline').waitFor();
    await near(page, 5);
  });
});

describe('A case that is damaged', () => {
  it('says so, and leads to its verification', async () => {
    const { page } = visitor;
    appliance.spoilLedger(damaged);
    await page.goto(`${appliance.url}#/cases/${damaged}`);
    const card = page.locator('.state-card');
    await card.getByText('This case cannot be shown.').waitFor();
    await expectFits(visitor, 'damaged');
    await card.getByRole('link', { name: 'Verify this case' }).click();
    await page.getByRole('heading', { name: 'Verification' }).waitFor();
  });
});
