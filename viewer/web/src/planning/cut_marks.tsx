// Cuts on the picture: the curve through their handles, and each handle as a button that a pointer or keys move.
import { t } from '@/i18n/i18n';
import { curveThrough, type HandleName, type ShownCut } from '@/planning/cut_handles';
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

export function CutMarks({ table }: { table: TableController }) {
  const { cuts, chosen } = table.handles.value;
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
                if (held && event.key.startsWith('Page')) announce(t('planning.handleDepthSaid', { mm: mm(held.depth_m) }));
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
