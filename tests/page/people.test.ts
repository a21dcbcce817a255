// Whom a case is about, and who may do what: patient, procedure and staff from the start of a recording to a search; passwords and roles of users.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { Appliance, keepPicture, seriousBarriers, settled, startBrowser, story, visit, visitSignedIn, type Visitor } from './kit';
import { expectFits } from './layout';

let appliance: Appliance;
let browser: Browser;
/** Who administers, and has unlocked (a demonstration unlocks by itself). */
let visitor: Visitor;
let id = '';

beforeAll(async () => {
  appliance = await Appliance.start();
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
});
afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

const signIn = async (page: Page, name: string, password: string) => {
  await page.getByLabel('Name').fill(name);
  await page.getByLabel('Password').fill(password);
  await page.keyboard.press('Enter');
};

const stop = async (page: Page) => {
  await page.getByRole('button', { name: 'Stop', exact: true }).click();
  await page.locator('dialog').getByRole('button', { name: 'Stop' }).click();
  await page.getByRole('button', { name: 'Start recording' }).waitFor();
};

story('Whom a case is about', (step) => {
  step('is asked for with the plan when a recording starts, which says what leaving it empty means, and begins at one more press of Enter', async () => {
    const { page } = visitor;
    await page.goto(`${appliance.url}#/rooms`);
    await page.getByRole('button', { name: 'Start recording' }).click();
    const dialog = page.getByRole('dialog', { name: 'Start recording in or-1' });
    await dialog.getByText('Nothing is recorded of the patient. It can be added while the recording runs, not afterwards.').waitFor();
    await dialog.getByText('No sealed plan lies in the folder').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(visitor, 'start');
    await page.keyboard.press('Enter');
    await page.locator('.room-recording').waitFor();
    await page.getByText('No patient recorded yet').waitFor();
  });

  step('can be added while it runs, and be corrected', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Add patient' }).click();
    const dialog = page.getByRole('dialog', { name: 'Whom is the case in or-1 about?' });
    await expect.poll(() => dialog.getByRole('button', { name: 'Record these data' }).isDisabled()).toBe(true);
    await dialog.getByLabel('Patient', { exact: true }).fill('Wrong Person');
    await dialog.getByRole('button', { name: 'Record these data' }).click();
    await page.getByText('Patient and procedure are recorded').first().waitFor();
    await page.getByRole('button', { name: 'Correct patient' }).click();
    await dialog.getByLabel('Patient', { exact: true }).fill('Yamada Tarou');
    await dialog.getByLabel('Patient number').fill('4711');
    await dialog.getByLabel('Procedure').fill('Cholecystectomy');
    await dialog.getByLabel('Surgeon').fill('Sato Hanako');
    await dialog.getByRole('button', { name: 'Record these data' }).click();
    await dialog.waitFor({ state: 'detached' });
    await page.waitForTimeout(2500);
    await stop(page);
    id = appliance.cases().at(-1) as string;
  });

  step('is taken as it was typed before it begins, with the plan that was chosen', async () => {
    const { page } = visitor;
    await appliance.sealPlan();
    await page.reload();
    await page.getByRole('button', { name: 'Start recording' }).click();
    const dialog = page.getByRole('dialog', { name: 'Start recording in or-1' });
    await dialog.getByLabel('Patient', { exact: true }).fill('Suzuki Jirou');
    await dialog.getByLabel('Sealed plan').selectOption({ index: 1 });
    await keepPicture(page, 'start');
    await dialog.getByRole('button', { name: 'Start with these data' }).click();
    await page.locator('.room-recording').waitFor();
    await page.getByText('Patient and procedure are recorded').waitFor();
    await page.waitForTimeout(2500);
    await stop(page);
    const opening = JSON.parse(
      readFileSync(join(appliance.home, 'archive', appliance.cases().at(-1) as string, 'ledger.jsonl'), 'utf8').split('\n')[0] as string,
    ) as { plan?: string };
    expect(opening.plan).toMatch(/^[0-9a-f]{64}$/);
  });

  step('stands in the list once it is unlocked, and is found there', async () => {
    const { page } = visitor;
    await page.goto(`${appliance.url}#/cases`);
    const row = page.locator('.case-row', { hasText: id });
    await row.getByText('Yamada Tarou (4711)').waitFor();
    await row.getByText('Cholecystectomy').waitFor();
    await row.getByText('Surgeon: Sato Hanako').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(visitor, 'cases-people');
    await keepPicture(page, 'cases');
    await page.getByRole('searchbox').fill('yamada chole');
    await expect.poll(() => page.locator('.case-row').count()).toBe(1);
    await page.getByRole('searchbox').fill('sato suzuki');
    await page.getByText('No case matches').waitFor();
    // Names never stand in an address, which logs keep.
    for (const address of visitor.asked) expect(address.toLowerCase()).not.toContain('yamada');
  });

  step('stands in the header of the case, with what was said before', async () => {
    const { page } = visitor;
    await page.goto(`${appliance.url}#/cases/${id}`);
    await settled(page);
    const head = page.locator('.case-head');
    await head.getByText('Yamada Tarou (4711)').waitFor();
    await head.getByText('Said before: 1').click();
    await head.getByText('Wrong Person').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(visitor, 'case-people');
    await page.getByRole('button', { name: '日本語' }).click();
    await head.getByText('執刀医: Sato Hanako').waitFor();
    await page.getByRole('button', { name: 'English' }).click();
  });

  step('is nowhere while it is locked, and the list has a way to unlock', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Lock pictures' }).click();
    await page.locator('.case-head').waitFor();
    await expect.poll(() => page.locator('.subject').count()).toBe(0);
    await page.goto(`${appliance.url}#/cases`);
    await page.getByText('Patient, procedure and staff are sealed.').waitFor();
    await page.locator('.case-row').first().waitFor();
    expect(await page.locator('body').textContent()).not.toContain('Yamada');
    await page.getByRole('searchbox').fill('yamada');
    await page.getByText('No case matches “yamada”.').waitFor();
    await page.getByRole('searchbox').fill('');
    await page.getByRole('button', { name: 'Unlock patients' }).click();
    await page.getByLabel('or paste the identity').fill(appliance.identity());
    await expectFits(visitor, 'unlock-list');
    await page.getByRole('button', { name: 'Unlock', exact: true }).click();
    await page.locator('.case-row', { hasText: 'Yamada Tarou' }).waitFor();
    await page.locator('dialog').waitFor({ state: 'detached' });
  });
});

story('An administrator', (step) => {
  step('resets a password, which is shown once; whoever has it chooses their own, and it works no second time', async () => {
    const { page } = visitor;
    await appliance.addUser('bea', 'surgeon');
    await page.goto(`${appliance.url}#/users`);
    await page.getByRole('button', { name: 'Reset password bea' }).click();
    const dialog = page.locator('dialog');
    await expectFits(visitor, 'reset');
    await dialog.getByRole('button', { name: 'Reset password' }).click();
    const given = await dialog.getByLabel('One-time password').inputValue();
    expect(given).toMatch(/^[0-9a-z]{5}(-[0-9a-z]{5}){3}$/);
    expect(await seriousBarriers(page)).toEqual([]);
    await dialog.getByRole('button', { name: 'Close' }).click();
    await page.locator('tr', { hasText: 'bea' }).getByText('one-time password').waitFor();
    expect(await page.locator('body').textContent()).not.toContain(given);

    const bea = await visit(browser);
    await bea.page.goto(appliance.url);
    await signIn(bea.page, 'bea', given);
    await bea.page.getByRole('heading', { name: 'Choose your own password' }).waitFor();
    await expect.poll(() => bea.page.getByRole('navigation').count()).toBe(0);
    expect(await seriousBarriers(bea.page)).toEqual([]);
    await expectFits(bea, 'password');
    await bea.page.getByLabel(/New password/).fill('battery staple 1');
    await bea.page.getByLabel('The same again').fill('battery staple 2');
    await bea.page.keyboard.press('Enter');
    await bea.page.getByText('The two are not the same.').waitFor();

    // Whoever found the slip of paper comes too late.
    const finder = await visit(browser);
    await finder.page.goto(appliance.url);
    await signIn(finder.page, 'bea', given);
    await finder.page.getByText('this one-time password was used already: ask an administrator for another').waitFor();
    await finder.context.close();

    await bea.page.getByLabel('The same again').fill('battery staple 1');
    await bea.page.keyboard.press('Enter');
    await bea.page.getByRole('heading', { name: 'Cases' }).waitFor();
    await bea.page.getByRole('button', { name: 'Sign out' }).click();
    await signIn(bea.page, 'bea', 'battery staple 1');
    await bea.page.getByRole('heading', { name: 'Cases' }).waitFor();

    // Who administers nothing changes it again whenever they like.
    await bea.page.getByRole('button', { name: 'Change my password' }).click();
    await bea.page.getByLabel('Password of now').fill('battery staple 1');
    await bea.page.getByLabel(/New password/).fill('battery staple 3');
    await bea.page.getByLabel('The same again').fill('battery staple 3');
    expect(await seriousBarriers(bea.page)).toEqual([]);
    await expectFits(bea, 'own-password');
    await bea.page.keyboard.press('Enter');
    await bea.page.getByText('Your password is changed.').waitFor();
    await bea.page.getByRole('button', { name: 'Sign out' }).click();
    await signIn(bea.page, 'bea', 'battery staple 3');
    await bea.page.getByRole('heading', { name: 'Cases' }).waitFor();
    await bea.context.close();
    // By a link one comes without a password, so there is none to change.
    await expect.poll(() => page.getByRole('button', { name: 'Change my password' }).count()).toBe(0);
  });

  step('changes a role, nobody’s own', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Change role bea' }).click();
    const dialog = page.getByRole('dialog', { name: 'Role of bea' });
    await expectFits(visitor, 'role');
    await dialog.getByRole('radio', { name: /Auditor/ }).check();
    await dialog.getByRole('button', { name: 'Change role' }).click();
    await page.locator('tr', { hasText: 'bea' }).getByText('Auditor', { exact: true }).waitFor();
    await expectFits(visitor, 'users-people');
    expect(visitor.problems).toEqual([]);
  });
});
