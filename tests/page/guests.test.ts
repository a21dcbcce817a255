// A guest who looks on by an invitation, in a browser of their own, before a kirokud that records.
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { Appliance, keepPicture, seriousBarriers, settled, signInToRooms, startBrowser, startRecording, story, visit, type Visitor } from './kit';
import { expectFits } from './layout';

let appliance: Appliance;
let browser: Browser;
let surgeon: Visitor;
let guest: Visitor;
let link = '';

beforeAll(async () => {
  appliance = await Appliance.start(true);
  browser = await startBrowser();
  surgeon = await visit(browser);
  guest = await visit(browser);
  const { page } = surgeon;
  await signInToRooms(page, appliance);
  await startRecording(page);
  await page
    .getByText(/Live, \d+\.\d\d s behind/)
    .first()
    .waitFor();
});

afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

const pane = (page: Page, stream: string) => page.locator(`.live-pane[data-stream=${stream}]`);

async function invite(name: string): Promise<string> {
  const { page } = surgeon;
  await page.getByRole('button', { name: 'Invite a guest' }).click();
  const dialog = page.locator('dialog');
  await dialog.getByLabel('Name of the guest').fill(name);
  await dialog.getByRole('button', { name: 'Make the invitation' }).click();
  const made = await dialog.getByLabel('Link of the invitation').inputValue();
  if (name === 'Dr. Sato') await keepPicture(page, 'invitation');
  expect(await seriousBarriers(page)).toEqual([]);
  await dialog.getByRole('button', { name: 'Close' }).click();
  return made;
}

story('An invitation', (step) => {
  step('is made for an hour, and its link is shown once', async () => {
    const { page } = surgeon;
    link = await invite('Dr. Sato');
    expect(link).toMatch(new RegExp(`^${appliance.url}#invitation=[\\w-]{43}$`));
    const line = page.locator('.guest-line', { hasText: 'Dr. Sato' });
    await line.getByText('Has not come yet').waitFor();
    await line.getByText('60 min left').waitFor();
  });

  step('lets the guest in when they say so, and the token stays in no address', async () => {
    const { page } = guest;
    await page.goto(link);
    await page.getByRole('heading', { name: 'You are invited to look on' }).waitFor();
    expect(page.url()).toBe(appliance.url);
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(guest, 'invited');
    await page.getByRole('button', { name: 'Look on' }).click();
    for (const stream of ['endoscope', 'room'])
      await pane(page, stream)
        .getByText(/Live, \d+\.\d\d s behind/)
        .waitFor();
    const token = link.split('=')[1] as string;
    for (const address of guest.asked) expect(address).not.toContain(token);
  });

  step('shows the pictures moving and how long they may be seen, and nothing else', async () => {
    const { page } = guest;
    const time = () =>
      pane(page, 'endoscope')
        .locator('video')
        .evaluate((video: HTMLVideoElement) => video.currentTime);
    const first = await time();
    await expect.poll(time).toBeGreaterThan(first + 1);
    await expect.poll(() => page.getByRole('timer').textContent()).toMatch(/5\d:\d\d/);
    await expect.poll(() => page.getByRole('navigation').count()).toBe(0);
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(guest, 'guest');
    await page.getByRole('button', { name: '日本語' }).click();
    await page.getByText('Dr. Sato として見学しています。').waitFor();
    await expect.poll(() => page.getByRole('timer').textContent()).toMatch(/5\d:\d\d/);
    await page.getByRole('button', { name: 'English' }).click();
  });

  step('tells the surgeon that the guest watches', async () => {
    await surgeon.page.locator('.guest-line', { hasText: 'Dr. Sato' }).getByText('Watches now').waitFor();
  });

  step('lets the guest point, and everybody sees the arrow where it points', async () => {
    const picture = await guest.page.locator('.live-pane[data-stream=endoscope] .pointer-layer').boundingBox();
    if (!picture) throw new Error('no picture to point on');
    const { mouse } = guest.page;
    await mouse.move(picture.x + 0.25 * picture.width, picture.y + 0.5 * picture.height);
    await mouse.down();
    await mouse.move(picture.x + 0.6 * picture.width, picture.y + 0.4 * picture.height, { steps: 10 });
    for (const { page } of [guest, surgeon]) {
      const arrow = page.locator('.live-pane[data-stream=endoscope] .pointer');
      await arrow.getByText('Dr. Sato (guest)').waitFor();
      await expect
        .poll(async () => {
          const box = await page.locator('.live-pane[data-stream=endoscope] .pointer-layer').boundingBox();
          const at = await arrow.locator('svg').boundingBox();
          return box && at ? Math.hypot((at.x - box.x) / box.width - 0.6, (at.y - box.y) / box.height - 0.4) : 1;
        })
        .toBeLessThan(0.01);
      await expect.poll(() => page.locator('.live-pane[data-stream=room] .pointer').count()).toBe(0);
      await page.locator('.lookers').getByText('Dr. Sato (guest)').waitFor();
    }
    await keepPicture(guest.page, 'guest');
    await keepPicture(surgeon.page, 'pointing-live');
    // Held still it stays.
    await guest.page.waitForTimeout(2500);
    await expect.poll(() => surgeon.page.locator('.pointer').count()).toBe(1);
    await mouse.up();
    await expect.poll(() => surgeon.page.locator('.pointer').count()).toBe(0);
  });

  step('lets everybody point also by keys', async () => {
    await surgeon.page.getByRole('application', { name: 'Point on Endoscope' }).focus();
    for (let i = 0; i < 5; ++i) {
      await surgeon.page.keyboard.press('ArrowRight');
      await surgeon.page.waitForTimeout(60);
    }
    await guest.page.locator('.live-pane[data-stream=endoscope] .pointer[data-by=anna]').waitFor();
  });

  step('survives that the page is loaded anew', async () => {
    const { page } = guest;
    await page.reload();
    await pane(page, 'endoscope')
      .getByText(/Live, \d+\.\d\d s behind/)
      .waitFor();
  });

  step('lets nobody in a second time', async () => {
    const other = await visit(browser);
    await other.page.goto(link);
    await other.page.getByRole('button', { name: 'Look on' }).click();
    await other.page.getByText(/was used before/).waitFor();
    await other.context.close();
  });

  step('ends when the surgeon ends it, and the guest is told', async () => {
    await surgeon.page.getByRole('button', { name: 'End the invitation of Dr. Sato' }).click();
    await guest.page.getByRole('heading', { name: 'The invitation has ended' }).waitFor();
    await expect.poll(() => guest.page.locator('video').count()).toBe(0);
    await surgeon.page.locator('.guest-line', { hasText: 'Dr. Sato' }).getByText('was ended').waitFor();
    await guest.page.reload();
    await guest.page.getByRole('heading', { name: 'Sign in' }).waitFor();
  });

  step('ends when the guest leaves', async () => {
    const second = await invite('Dr. Mori');
    const { page } = guest;
    await page.goto(second);
    await page.getByRole('button', { name: 'Look on' }).click();
    await page.getByRole('button', { name: 'Leave' }).click();
    await page.locator('dialog').getByRole('button', { name: 'Leave' }).click();
    await page.getByRole('heading', { name: 'The invitation has ended' }).waitFor();
    await surgeon.page.locator('.guest-line', { hasText: 'Dr. Mori' }).getByText('left').waitFor();
  });

  step('ends with the case', async () => {
    const third = await invite('Dr. Abe');
    await guest.page.goto(third);
    await guest.page.getByRole('button', { name: 'Look on' }).click();
    await pane(guest.page, 'endoscope')
      .getByText(/Live, \d+\.\d\d s behind/)
      .waitFor();
    await appliance.kiroku('case', 'stop');
    await guest.page.getByRole('heading', { name: 'The invitation has ended' }).waitFor();
  });

  step('leaves in the case where the guest pointed, at its moment', async () => {
    const { page } = surgeon;
    const id = appliance.cases().at(-1) as string;
    const { strokes } = (await page.evaluate(async (id) => (await fetch(`/api/cases/${id}/pointing`)).json() as Promise<unknown>, id)) as {
      strokes: { by: string; start_ns: number; end_ns: number }[];
    };
    expect(strokes.map((one) => one.by)).toEqual(['Dr. Sato', 'anna']);
    const first = strokes[0] as { start_ns: number; end_ns: number };
    // At its end it was held still.
    const still_s = (first.end_ns - 1.5e9) / 1e9;
    await page.goto(`${appliance.url}#/cases/${id}?t=${still_s}`);
    const arrow = page.locator('.pane[data-stream=endoscope] .pointer');
    await arrow.getByText('Dr. Sato (guest)').waitFor();
    // The pointer may be there before the video has a size, by which both are laid out.
    const videoShape = () => page.locator('.pane[data-stream=endoscope] video').evaluate((video: HTMLVideoElement) => video.videoWidth / video.videoHeight);
    await expect.poll(videoShape, { timeout: 30_000 }).toBeGreaterThan(0);
    const shown = await videoShape();
    const place = async () => {
      const box = await page.locator('.pane[data-stream=endoscope] .pointer-layer').boundingBox();
      const at = await arrow.locator('svg').boundingBox();
      if (!box || !at) throw new Error('no arrow');
      // The picture lies in the middle of its pane.
      const width = Math.min(box.width, box.height * shown);
      const height = width / shown;
      return [(at.x - box.x - (box.width - width) / 2) / width, (at.y - box.y - (box.height - height) / 2) / height];
    };
    await expect.poll(place).toEqual([expect.closeTo(0.6, 1), expect.closeTo(0.4, 1)]);
    await page.locator('.lane-names').getByText('Pointing').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await settled(page);
    await keepPicture(page, 'pointing');
    await page.goto(`${appliance.url}#/cases/${id}?t=${first.start_ns / 1e9 - 1}`);
    await expect.poll(() => arrow.count()).toBe(0);
    expect(surgeon.problems).toEqual([]);
    expect(guest.problems).toEqual([]);
  });
});
