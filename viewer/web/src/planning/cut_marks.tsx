// Cuts on the picture: the curve through their handles, and each handle as a button that a pointer or keys move.
import { useLayoutEffect } from 'preact/hooks';
import { t } from '@/i18n/i18n';
import { curveThrough, type HandleName, type ShownCut, type ShownHandle } from '@/planning/cut_handles';
import type { TableController } from '@/planning/table_controller';
import { announce } from '@/shell/state';

const mm = (length_m: number) => (1000 * length_m).toFixed(0);

/** Which handle the event is on. */
export function handleOf(event: Event): HandleName | undefined {
  const mark = (event.target as Element).closest<HTMLElement>('.cut-handle');
  if (!mark) return undefined;
  return { step: Number(mark.dataset['step']), handle: Number(mark.dataset['handle']) };
}

function Curve({ cut }: { cut: ShownCut }) {
  return (
    <polyline
      points={curveThrough(cut.handles, cut.smooth)
        .map(({ x, y }) => `${x},${y}`)
        .join(' ')}
    />
  );
}

/** A button outside the picture would be a tab stop that nobody sees. */
const onPicture = ({ x, y }: ShownHandle) => x >= 0 && x <= 1 && y >= 0 && y <= 1;
const percent = (part: number) => Math.round(100 * part);

function say(key: string, n: number, held: ShownHandle): void {
  if (key.startsWith('Page')) announce(t('planning.handleDepthSaid', { mm: mm(held.depth_m) }));
  else if (!key.startsWith('Arrow')) return;
  else if (held.hidden) announce(t('planning.handleHiddenSaid', { n }));
  else announce(t('planning.handleMovedSaid', { n, x: percent(held.x), y: percent(held.y) }));
}

export function CutMarks({ table, focusField }: { table: TableController; focusField: () => void }) {
  const { cuts, chosen } = table.handles.value;
  // Focus does not fall to the page when the button that has it goes with its cut, or leaves the picture.
  const focused = document.activeElement?.closest('.cut-handle');
  useLayoutEffect(() => {
    if (focused && !focused.isConnected) focusField();
  });
  if (cuts.length === 0) return null;
  return (
    <>
      <svg class="planning-line cut-curve" viewBox="0 0 1 1" preserveAspectRatio="none" aria-hidden="true">
        {cuts.map((cut) => (
          <Curve key={cut.step} cut={cut} />
        ))}
      </svg>
      {cuts.map((cut) =>
        cut.handles.map((one, handle) => {
          if (!onPicture(one)) return null;
          const name = { step: cut.step, handle };
          const isChosen = chosen?.step === cut.step && chosen.handle === handle;
          const where = { n: handle + 1, all: cut.handles.length, step: cut.step + 1, mm: mm(one.depth_m) };
          return (
            <button
              key={`${cut.step}-${handle}`}
              type="button"
              class={`cut-handle${isChosen ? ' cut-handle-chosen' : ''}${one.hidden ? ' cut-handle-hidden' : ''}`}
              style={{ left: `${one.x * 100}%`, top: `${one.y * 100}%` }}
              data-step={cut.step}
              data-handle={handle}
              aria-pressed={isChosen}
              aria-label={t(one.hidden ? 'planning.handleHidden' : 'planning.handle', where)}
              onFocus={() => table.chooseHandle(name)}
              onKeyDown={(event) => {
                if (event.ctrlKey || event.metaKey || event.altKey) return;
                if (!table.keyOfHandle(event.key, event.shiftKey, event.timeStamp)) return;
                event.preventDefault();
                event.stopPropagation();
                const held = table.handles.value.held;
                if (held) say(event.key, where.n, held);
              }}
            >
              <span aria-hidden="true">{isChosen ? `${where.n} · ${where.mm} mm` : where.n}</span>
            </button>
          );
        }),
      )}
    </>
  );
}
