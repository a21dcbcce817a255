// The hospital's page: rooms of all appliances as they reported, their cases and what is known of the appliances. PostgreSQL and kiroku-fleet serve are real;
// what the appliances said is put into the database, so that every state is there at once.
import { type ChildProcess, execFile, spawn } from 'node:child_process';
import { createHmac, hkdfSync, randomBytes } from 'node:crypto';
import { chmodSync, existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { promisify } from 'node:util';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect } from 'vitest';
import { keepPicture, seriousBarriers, startBrowser, story, until, visit, type Visitor } from './kit';
import { expectFits } from './layout';

const run = promisify(execFile);
const source = process.env['KIROKU_SOURCE_DIR'] ?? '';
const kiroku = process.env['KIROKU_PROGRAM'] ?? '';
const page = process.env['KIROKU_PAGE'] ?? '';
const hasDatabase = existsSync('/usr/lib/postgresql');

const kDay_s = 86_400;
const room = (name: string, state: string, more: object = {}) => ({
  room: name,
  state,
  case: '20261127T085000Z-3f9c21ab',
  recording_s: state === 'recording' ? 1800 : 0,
  streams: 3,
  silent: [],
  lost: 0,
  missed: 0,
  problem: false,
  not_resumed: false,
  ended_by_error: false,
  without_box: false,
  ...more,
});
const report = (rooms: object[], more: object = {}, not_shared = false) =>
  JSON.stringify({
    format: 1,
    program: '0.1.0',
    run: 'a'.repeat(32),
    number: 1,
    now: new Date().toISOString(),
    recorder: {
      up_s: kDay_s,
      rooms,
      authorities: [{ name: 'freetsa', failures: 0, token_s: 30, not_shared }],
      disk: { free_bytes: 1e12, total_bytes: 2e12, hours_left: 120.5 },
      clock: { synchronised: true, error_ns: 1_000_000 },
    },
    has_store: true,
    shipping: { waiting: 0, waiting_bytes: 0, waiting_s: null, holds: 0, problems: 0 },
    ...more,
  });

/** A search note of or-1's first key (docs/reference/format-recovery.md), as an appliance writes it of a patient and a procedure. */
function searchNote(site: Buffer, caseId: string, patient: string, code: string): string {
  const mac = (key: Buffer, ...lines: string[]) => createHmac('sha256', key).update(lines.join('\n')).digest();
  const random = randomBytes(8).toString('hex');
  const series = random + mac(site, 'kiroku search series', 'or-1', random).subarray(0, 8).toString('hex');
  const chain = Buffer.from(hkdfSync('sha256', site, series, 'kiroku search appliance\nor-1', 32));
  const key = mac(chain, 'kiroku search note');
  const word = (...what: string[]) =>
    mac(key, 'kiroku search word', caseId, ...what)
      .subarray(0, 16)
      .toString('hex');
  const unknown = () => randomBytes(16).toString('hex');
  const words = word('patient', patient) + unknown() + word('procedure', code) + unknown();
  const whole = mac(key, 'kiroku search mac', caseId, series, '0', caseId, series, '0', words).toString('hex');
  const of = { case: caseId, series, step: 0, words_case: caseId, words_series: series, words_step: 0 };
  return JSON.stringify({ format: 'kiroku-search/1', ...of, words, mac: whole }) + '\n';
}

class Hospital {
  private constructor(
    readonly folder: string,
    private readonly connection: string,
    private readonly server: ChildProcess,
    readonly url: string,
    readonly signIn: string,
  ) {}

  static async open(): Promise<Hospital> {
    const folder = mkdtempSync(join(tmpdir(), 'kiroku-fleet-'));
    chmodSync(folder, 0o755);
    const { stdout } = await run(join(source, 'tests/fleet/postgres.sh'), ['up', join(folder, 'postgres')]);
    const connection = stdout.trim().split('\n').at(-1) ?? '';
    const configuration = join(folder, 'fleet.toml');
    writeFileSync(configuration, `[store]\nendpoint = "https://127.0.0.1:1"\nbucket = "recordings"\n[catalogue]\nconnection = "${connection}"\n`);
    const fleet = join(dirname(kiroku), 'kiroku-fleet');
    await run(fleet, ['init', '--config', configuration]);
    await run(kiroku, ['init', '--demo', '--home', join(folder, 'page')]);
    const searchKey = join(folder, 'site-search.key');
    await run(fleet, ['search-key', '-o', searchKey]);
    const server = spawn(
      fleet,
      [
        ...['serve', '--home', join(folder, 'page'), '--config', configuration, '--search-key', searchKey],
        ...['--listen', '127.0.0.1:0', '--reports', '127.0.0.1:0', '--web', page, '--json'],
      ],
      { stdio: ['ignore', 'pipe', 'inherit'] },
    );
    let said = '';
    server.stdout.on('data', (bytes: Buffer) => (said += bytes.toString()));
    const answer = await until('kiroku-fleet serves', () => {
      try {
        return JSON.parse(said) as { url: string; sign_in: string };
      } catch {
        return undefined;
      }
    });
    return new Hospital(folder, connection, server, answer.url.replace(/\/?$/, '/'), answer.sign_in);
  }

  async tell(statement: string): Promise<void> {
    await run('psql', [this.connection, '-v', 'ON_ERROR_STOP=1', '-c', statement]);
  }

  /** As if the appliance had said this so many seconds ago. */
  async hear(name: string, said: string, ago_s: number): Promise<void> {
    await this.tell(
      `INSERT INTO kiroku.appliances (name, enrolled_by, certificate, certificate_until, heard, report)
       VALUES ('${name}', 'anna', '00', now() + interval '60 days', now() - interval '${ago_s} seconds', '${said}')
       ON CONFLICT (name) DO UPDATE SET heard = excluded.heard, report = excluded.report`,
    );
  }

  private readonly reporters: NodeJS.Timeout[] = [];
  /** Again and again, as an appliance reports. */
  async keepHearing(name: string, say: () => string): Promise<void> {
    await this.hear(name, say(), 0);
    this.reporters.push(setInterval(() => void this.hear(name, say(), 0).catch(() => undefined), 3000));
  }

  async close(): Promise<void> {
    this.reporters.forEach(clearInterval);
    this.server.kill('SIGKILL');
    await run(join(source, 'tests/fleet/postgres.sh'), ['down', join(this.folder, 'postgres')]).catch(() => undefined);
    rmSync(this.folder, { recursive: true, force: true });
  }
}

describe.skipIf(!hasDatabase)('On the page of a hospital', () => {
  let hospital: Hospital;
  let browser: Browser;
  let visitor: Visitor;

  beforeAll(async () => {
    hospital = await Hospital.open();
    browser = await startBrowser();
    visitor = await visit(browser);
    await visitor.page.goto(hospital.signIn);
    await visitor.page.getByRole('heading', { name: 'Cases' }).waitFor();
  });
  afterAll(async () => {
    await browser?.close();
    await hospital?.close();
  });

  const heads = async () => (await visitor.page.locator('.fleet-room h2').allTextContents()).map((text) => text.split(' 0.')[0]);

  story('all rooms are seen', (step) => {
    step('with nobody enrolled it says what to do', async () => {
      const { page: here } = visitor;
      await here.getByRole('link', { name: 'Rooms' }).click();
      await here.getByText('No appliance is enrolled.').waitFor();
    });

    step('what needs a person is first, and what was not heard of is not shown as if it were live', async () => {
      const { page: here } = visitor;
      await hospital.keepHearing('or-1', () => report([room('or-1', 'recording'), room('or-2', 'standby')]));
      await hospital.hear('or-3', report([room('or-3', 'recording')], { now: new Date(Date.now() - 3_600_000).toISOString() }), 3600);
      await hospital.keepHearing('or-4', () => report([room('or-4', 'recording', { silent: ['endoscope'], lost: 12 })], {}, true));
      await here.locator('.fleet-room').nth(3).waitFor();
      await expect.poll(heads).toEqual(['or-3', 'or-4', 'or-1', 'or-1 · or-2']);
      const unheard = here.locator('.fleet-room').first();
      await unheard.getByText('Was recording').waitFor();
      await unheard.getByText(/^Not heard of since/).waitFor();
      await unheard.getByText('what it does now is not known').waitFor();
      await expect.poll(() => unheard.getByText('Recording', { exact: true }).count()).toBe(0);
      // Nor is any fact of then told as of now.
      await expect.poll(() => unheard.getByText(/^(Clock|Authorities|Not shipped)$/).count()).toBe(0);
      await here.locator('.fleet-room').nth(1).getByText('A source is silent: Endoscope').waitFor();
      await here.locator('.fleet-room').nth(1).getByText('Its time-stamps are not shared with other rooms').waitFor();
      expect(await seriousBarriers(here)).toEqual([]);
      await expectFits(visitor, 'fleet-rooms');
      await keepPicture(here, 'fleet-rooms');
    });

    step('in Japanese, too', async () => {
      const { page: here } = visitor;
      await here.getByRole('button', { name: '日本語' }).click();
      await here.getByText('最後の報告では記録中').waitFor();
      await here
        .getByText('無信号の入力があります：')
        .or(here.getByText(/無信号の入力があります/))
        .first()
        .waitFor();
      await keepPicture(here, 'fleet-rooms-ja');
      await here.getByRole('button', { name: 'English' }).click();
    });

    step('a wrong code enrols nobody', async () => {
      const { page: here } = visitor;
      await here.getByRole('button', { name: 'Enrol an appliance' }).click();
      const dialog = here.getByRole('dialog', { name: 'Enrol an appliance' });
      await dialog.getByLabel('Code').fill('0000-0000-0000-0000');
      expect(await seriousBarriers(here)).toEqual([]);
      await dialog.getByRole('button', { name: 'Enrol an appliance' }).click();
      await here.getByText('no appliance that waits shows this code').first().waitFor();
      await here.keyboard.press('Escape');
    });

    step('where the database does not answer, no room is shown', async () => {
      const { page: here } = visitor;
      await hospital.tell('ALTER TABLE kiroku.appliances RENAME TO away');
      await here.getByText(/^What the rooms do is not known/).waitFor();
      await expect.poll(() => here.locator('.fleet-room').count()).toBe(0);
      await hospital.tell('ALTER TABLE kiroku.away RENAME TO appliances');
      await here.locator('.fleet-room').nth(3).waitFor();
      // That it was so is why the browser complains.
      visitor.problems.length = 0;
    });
  });

  story('cases and appliances are listed', (step) => {
    step('as the catalogue knows them', async () => {
      const { page: here } = visitor;
      await hospital.tell(
        `INSERT INTO kiroku.cases (appliance, case_id, opened, duration_ns, state, streams, segments, bytes, tokens, ledger_bytes, changed, verdict, verified, alarm)
         VALUES ('or-1', '20261127T085000Z-3f9c21ab', '2026-11-27 08:50Z', 60000000000, 'closed', 'endoscope', 6, 1000000, 2, 10, 1, 'tampered', now(), true),
                ('or-9', '20261126T085000Z-3f9c21ab', '2026-11-26 08:50Z', 60000000000, 'closed', 'endoscope', 6, 1000000, 2, 10, 1, NULL, NULL, false)`,
      );
      await here.getByText('Cases in the store, and no reports: or-9.').waitFor();
      await here.getByRole('link', { name: 'Appliances' }).click();
      await here.getByRole('row', { name: /or-1/ }).getByText('1 not intact').waitFor();
      expect(await seriousBarriers(here)).toEqual([]);
      await here.getByRole('link', { name: 'or-9' }).click();
      await expect.poll(() => here.locator('.case-row').count()).toBe(1);
      await here.getByRole('link', { name: 'Cases', exact: true }).click();
      await here.getByLabel('Needs a person').check();
      await expect.poll(() => here.locator('.case-row').count()).toBe(1);
      await here.locator('.case-row').getByText('or-1').waitFor();
      expect(await seriousBarriers(here)).toEqual([]);
    });
    step('never under another question than theirs', async () => {
      const { page: here } = visitor;
      await here.getByLabel('Needs a person').uncheck();
      await expect.poll(() => here.locator('.case-row').count()).toBe(2);
      await hospital.tell('ALTER TABLE kiroku.cases RENAME TO away');
      await here.getByLabel('Verdict').selectOption('incomplete');
      await here.getByText('The program behind this page gave no answer.').waitFor();
      await expect.poll(() => here.locator('.case-row').count()).toBe(0);
      expect(await seriousBarriers(here)).toEqual([]);
      await hospital.tell('ALTER TABLE kiroku.away RENAME TO cases');
      await here.getByRole('button', { name: 'Try again' }).click();
      await here.getByText('No case is so.').waitFor();
      // That it was so is why the browser complains.
      visitor.problems.length = 0;
    });
    step('with what is not proven apart from what is not intact', async () => {
      const { page: here } = visitor;
      await hospital.tell("UPDATE kiroku.cases SET verdict = 'unproven', verified = now() WHERE appliance = 'or-9'");
      await here.getByRole('link', { name: 'Appliances' }).click();
      const row = here.getByRole('row', { name: /or-9/ });
      await row.getByText('1 unproven').waitFor();
      await expect.poll(() => row.getByText('not intact').count()).toBe(0);
    });
    step('found by patient and procedure, where the server has the search key', async () => {
      const { page: here } = visitor;
      const site = readFileSync(join(hospital.folder, 'site-search.key'), 'utf8').trim().split(' ').at(-1) ?? '';
      const id = '20261127T085000Z-3f9c21ab';
      const note = searchNote(Buffer.from(site, 'hex'), id, '4711', 'k653');
      await hospital.tell(`INSERT INTO kiroku.search_notes (appliance, case_id, version, note) VALUES ('or-1', '${id}', '1', '${note}')`);
      const sent: string[] = [];
      here.on('request', (request) => sent.push(`${request.method()} ${request.url()}`));
      await here.getByRole('link', { name: 'Cases', exact: true }).click();
      await expect.poll(() => here.locator('.case-row').count()).toBe(2);
      const search = here.getByRole('search', { name: 'Search by patient or procedure' });
      await search.getByLabel('Patient’s number').fill(' 004711');
      expect(sent.filter((one) => one.includes('search'))).toEqual([]); // nothing is asked for while somebody types
      await here.keyboard.press('Enter');
      await here.getByText('Cases looked at: 2. Of them without a search note, and so never found: 1.').waitFor();
      await expect.poll(() => here.locator('.case-row').count()).toBe(1);
      await here.locator('.case-row').getByText('or-1').waitFor();
      expect(await seriousBarriers(here)).toEqual([]);
      await expectFits(visitor, 'fleet-search');
      await keepPicture(here, 'fleet-search');
      await here.getByRole('button', { name: 'Light colours' }).click();
      expect(await seriousBarriers(here)).toEqual([]);
      await keepPicture(here, 'fleet-search-light');
      await here.getByRole('button', { name: 'Dark colours' }).click();
      // By the keyboard alone: the procedure, then Search.
      await search.getByLabel('Patient’s number').focus();
      await here.keyboard.press('Tab');
      await here.keyboard.type('K654');
      await here.keyboard.press('Tab');
      await here.keyboard.press('Enter');
      await here.getByText('that none is, proves nothing').waitFor();
      await expect.poll(() => here.locator('.case-row').count()).toBe(0);
      await search.getByRole('button', { name: 'Clear the search' }).click();
      await expect.poll(() => here.locator('.case-row').count()).toBe(2);
      await expect.poll(() => search.getByLabel('Procedure’s code').inputValue()).toBe('');
      expect(sent.filter((one) => /4711|k65/i.test(one))).toEqual([]);
      expect(await here.content()).not.toContain(site);
    });
    step('in Japanese, too, and what cannot be searched is said', async () => {
      const { page: here } = visitor;
      await here.getByRole('button', { name: '日本語' }).click();
      const search = here.getByRole('search', { name: '患者または術式で検索' });
      await search.getByLabel('術式コード').fill('K653');
      await search.getByRole('button', { name: '検索', exact: true }).click();
      await here.getByText('調べた症例：2 件。').waitFor();
      await expect.poll(() => here.locator('.case-row').count()).toBe(1);
      expect(await seriousBarriers(here)).toEqual([]);
      await keepPicture(here, 'fleet-search-ja');
      await here.getByRole('button', { name: 'English' }).click();
      await here.getByLabel('Patient’s number').fill('000');
      await here.keyboard.press('Enter');
      await here.getByText('nothing can be searched').first().waitFor();
      await here.getByRole('button', { name: 'Clear the search' }).click();
      // That it was so is why the browser complains.
      visitor.problems.length = 0;
    });
    step('of which the log tells, and not whom it was about', async () => {
      const { page: here } = visitor;
      await here.getByRole('link', { name: 'Log', exact: true }).click();
      await here.getByText('searched for cases of a patient').first().waitFor();
      expect(await here.content()).not.toMatch(/4711/);
    });
    step('without anything that the page complains of', () => {
      expect(visitor.problems).toEqual([]);
    });
  });
});
