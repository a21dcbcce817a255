// One address, one sign-in: from the cases to planning and training and back, as a surgeon, an operator and an administrator see it. Real programs:
// `kiroku view`, `kiroku plan serve` and `kiroku train serve`, which come and go.
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { Appliance, keepPicture, seriousBarriers, startBrowser, story, visit, type Visitor } from './kit';
import { expectFits } from './layout';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;

beforeAll(async () => {
  appliance = await Appliance.alone();
  await appliance.sealPlan();
  await appliance.addUser('anna', 'surgeon');
  await appliance.addUser('otto', 'operator');
  browser = await startBrowser();
});
afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

const page = () => visitor.page;
const nav = (name: string) =>
  page()
    .getByRole('navigation')
    .getByRole('link', { name: new RegExp(`^${name}`) });

async function signIn(user: string): Promise<void> {
  await page().goto(appliance.url);
  await page().getByLabel('Name').fill(user);
  await page().getByLabel('Password').fill(appliance.password);
  await page().keyboard.press('Enter');
  await page().getByRole('heading', { name: 'Cases' }).waitFor();
}

story('One entrance', (step) => {
  step('says what does not run, and how to get it', async () => {
    visitor = await visit(browser);
    await signIn('anna');
    await nav('Planning').click();
    await page().getByRole('heading', { name: 'Planning does not run now.' }).waitFor();
    await page().getByText('kiroku-planning').waitFor();
    expect(await seriousBarriers(page())).toEqual([]);
    await keepPicture(page(), 'entrance-away');
    await expectFits(visitor, 'entrance-away');
    await nav('Training').click();
    await page().getByRole('heading', { name: 'Training does not run now.' }).waitFor();
  });

  step('goes on by itself once it runs', async () => {
    await appliance.serveTraining();
    await page().getByRole('heading', { name: 'Push an organ aside' }).waitFor();
    await appliance.servePlanning();
    await nav('Planning').click();
    await page().getByRole('heading', { name: 'Plan an operation' }).waitFor();
    await expect.poll(() => nav('Planning').getAttribute('aria-current')).toBe('page');
    await keepPicture(page(), 'entrance');
    await expectFits(visitor, 'entrance');
  });

  step('says why where a program gives no answer, and goes on by itself once it does', async () => {
    for (const [name, path, heading] of [
      ['Training', 'training', 'Push an organ aside'],
      ['Planning', 'planning/plans', 'Plan an operation'],
    ] as const) {
      await nav('Cases').click();
      await page().getByRole('heading', { name: 'Cases' }).waitFor();
      const late = `${appliance.url}api/${path}`;
      await page().route(late, (route) => route.fulfill({ status: 504, json: { error: 'the program behind this page does not answer in time' } }));
      await nav(name).click();
      await page().getByRole('heading', { name: 'The program behind this page gave no answer.' }).waitFor();
      await page().getByText('does not answer in time').waitFor();
      await page().unroute(late);
      await page().getByRole('heading', { name: heading }).waitFor();
    }
    // That answer was this test's.
    visitor.problems.splice(0);
  });

  step('leads to each by the keyboard', async () => {
    for (const [name, heading] of [
      ['Training', 'Push an organ aside'],
      ['Planning', 'Plan an operation'],
      ['Cases', 'Cases'],
    ] as const) {
      await nav(name).focus();
      await page().keyboard.press('Enter');
      await page().getByRole('heading', { name: heading, exact: true }).waitFor();
    }
  });

  step('plans by the viewer’s address: pictures come, deeds go', async () => {
    await nav('Planning').click();
    await page()
      .getByRole('button', { name: /^Begin anew on / })
      .click();
    await page().locator('.planning-field[aria-busy=false]').waitFor();
    await page().keyboard.press('g');
    const box = await page().locator('.planning-field').boundingBox();
    if (!box) throw new Error('there is no picture');
    await page().mouse.move(box.x + 0.4 * box.width, box.y + 0.62 * box.height);
    await page().mouse.down();
    await page().mouse.move(box.x + 0.34 * box.width, box.y + 0.72 * box.height, { steps: 20 });
    await page().mouse.up();
    await expect.poll(() => page().locator('.planning-steps li').count()).toBe(2);
  });

  step('leaves no plan with steps that are not saved before it was asked', async () => {
    let asked = 0;
    const answer = (accept: boolean) =>
      page().once('dialog', (dialog) => {
        ++asked;
        void (accept ? dialog.accept() : dialog.dismiss());
      });
    answer(false);
    await nav('Cases').click();
    await expect.poll(() => asked).toBe(1);
    await expect.poll(() => page().locator('.planning-steps li').count()).toBe(2);
    expect(new URL(page().url()).hash).toBe('#/planning');
    answer(true);
    await nav('Cases').click();
    await page().getByRole('heading', { name: 'Cases' }).waitFor();
    expect(asked).toBe(2);
    // Nothing is lost by leaving what is only looked at.
    await nav('Planning').click();
    await page()
      .getByRole('button', { name: /^Begin anew on / })
      .click();
    await page().locator('.planning-field[aria-busy=false]').waitFor();
    await nav('Training').click();
    await page().getByRole('heading', { name: 'Push an organ aside' }).waitFor();
    expect(asked).toBe(2);
  });

  step('signs out of all at once', async () => {
    await page().getByRole('button', { name: 'Sign out' }).click();
    await page().getByLabel('Password').waitFor();
    await page().goto(`${appliance.url}#/planning`);
    await page().getByLabel('Password').waitFor();
    expect((await page().request.get(`${appliance.url}api/planning/plans`)).status()).toBe(401);
  });

  step('tells an operator what they may not, and who may give it', async () => {
    await signIn('otto');
    await nav('Planning').click();
    await page().getByRole('heading', { name: 'The role operator may not use: Planning.' }).waitFor();
    await page().getByText('Ask an administrator').waitFor();
    await page().getByRole('button', { name: '日本語' }).click();
    await page().getByRole('heading', { name: '操作者の役割では「計画」を利用できません。' }).waitFor();
    expect(await seriousBarriers(page())).toEqual([]);
    await keepPicture(page(), 'entrance-japanese');
    await nav('訓練').click();
    await page().locator('.train-choice').waitFor();
    await page().getByRole('button', { name: 'English' }).click();
  });

  step('asks nothing of anybody else, and nothing goes wrong', () => {
    const own = new URL(appliance.url).origin;
    expect(visitor.asked.filter((address) => !address.startsWith(own) && !/^(blob|data):/.test(address))).toEqual([]);
    expect(visitor.problems).toEqual([]);
  });
});
