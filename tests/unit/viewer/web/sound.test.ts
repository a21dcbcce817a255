import { beforeEach, describe, expect, it, vi } from 'vitest';
import { common } from '@/base/spans';
import { actionOf } from '@/views/keyboard';

const kept = new Map<string, string>();
vi.stubGlobal('sessionStorage', { getItem: (key: string) => kept.get(key) ?? null, setItem: (key: string, value: string) => kept.set(key, value) });
const load = async () => {
  vi.resetModules();
  return import('@/media/pane_sound');
};
type Module = Awaited<ReturnType<typeof load>>;
const panes = (of: Module, sounds: Record<string, boolean>) => {
  const all = Object.entries(sounds).map(([stream, isThere]) => {
    const pane = new of.PaneSound(stream);
    pane.isThere.value = isThere;
    return pane;
  });
  for (const pane of all) pane.isMaster.value = pane === all.find((one) => one.isThere.value);
  return all;
};

beforeEach(() => kept.clear());

describe('Sound', () => {
  it('is heard of the master alone, unless somebody chose otherwise', async () => {
    const of = await load();
    const all = panes(of, { fluoroscopy: false, endoscope: true, room: true });
    expect(all.map((one) => one.muted.value)).toEqual([true, false, true]);
    all[2]?.mute(false);
    all[1]?.mute(true);
    expect(all.map((one) => one.muted.value)).toEqual([true, true, false]);
  });

  it('goes off everywhere by one key, and on again at the master', async () => {
    const of = await load();
    const all = panes(of, { endoscope: true, room: true });
    all[1]?.mute(false);
    expect(of.toggleSound(all)).toBe('off');
    expect(all.every((one) => one.muted.value)).toBe(true);
    all[0]?.setVolume(0);
    expect(of.toggleSound(all)).toBe('on');
    expect(all.map((one) => [one.muted.value, one.volume.value])).toEqual([
      [false, 1],
      [true, 1],
    ]);
    // By its own button too: what was turned down to nothing is not told to be on while nothing is heard.
    all[1]?.setVolume(0);
    all[1]?.mute(false);
    expect([all[1]?.muted.value, all[1]?.volume.value]).toEqual([false, 1]);
    expect(of.toggleSound(panes(of, { endoscope: false }))).toBe('none');
    expect(actionOf({ key: 'm', shiftKey: false, ctrlKey: false, altKey: false, metaKey: false })).toBe('soundOrMatch');
  });

  it('is remembered while the tab is open, and nothing else is believed', async () => {
    const [pane] = panes(await load(), { endoscope: true });
    pane?.setVolume(0.3);
    pane?.mute(true);
    const [again] = panes(await load(), { endoscope: true });
    expect([again?.muted.value, again?.volume.value]).toEqual([true, 0.3]);
    const of = await load();
    expect(of.readChoices('no text of ours')).toEqual({});
    expect(of.readChoices('{"room":{"muted":1,"volume":7},"x":null}')).toEqual({ room: {}, x: {} });
  });

  it('is heard at speeds at which speech is understood', async () => {
    const { isHeardAt } = await load();
    expect([0.25, 0.5, 1, 2, 4].map(isHeardAt)).toEqual([false, true, true, true, false]);
  });

  it('and pictures are there where both are', () => {
    const span = (start_ns: number, end_ns: number) => ({ start_ns, end_ns });
    expect(common([span(0, 4), span(6, 9)], [span(1, 7), span(8, 20)])).toEqual([span(1, 4), span(6, 7), span(8, 9)]);
    expect(common([span(0, 4)], [span(4, 8)])).toEqual([]);
  });
});
