// The tools of a plan that is made by hand, with how deep the chosen one goes.
import { useRef } from 'preact/hooks';
import { t } from '@/i18n/i18n';
import { kMostDepth_m } from '@/planning/cut_handles';
import { kFirstView } from '@/planning/orbit';
import { kKeyOfTool, kTools, type TableController, type Tool } from '@/planning/table_controller';
import { Icon } from '@/shell/icon';

export const kHold_s = 0.5;

interface Depths {
  label: string;
  most_mm: number;
  at_m: number;
  set: (depth_m: number) => void;
  /** Once the person lets the slider go: keys do so by Enter, or when they go on to something else. */
  done?: () => void;
  putBack?: () => void;
}

function Depth({ label, most_mm, at_m, set, done, putBack }: Depths) {
  // To a browser each arrow is a change of its own.
  const byKeys = useRef(false);
  return (
    <label class="planning-depth">
      <span>{label}</span>
      <input
        type="range"
        min={1}
        max={most_mm}
        value={1000 * at_m}
        onInput={(event) => set(Number(event.currentTarget.value) / 1000)}
        onPointerDown={() => (byKeys.current = false)}
        onKeyDown={({ key }) => {
          byKeys.current = true;
          if (key === 'Enter') done?.();
          else if (key === 'Escape') putBack?.();
        }}
        onChange={() => byKeys.current || done?.()}
        onBlur={() => done?.()}
      />
      <span class="mono">{Math.round(1000 * at_m)} mm</span>
    </label>
  );
}

export function Palette({ table, choose }: { table: TableController; choose: (tool: Tool) => void }) {
  const tool = table.tool.value;
  const { chosen, held } = table.handles.value;
  return (
    <div class="planning-palette" role="toolbar" aria-label={t('planning.tools')}>
      {kTools.map((one) => (
        <button key={one} type="button" class="button" aria-pressed={tool === one} onClick={() => choose(one)} title={kKeyOfTool[one].toUpperCase()}>
          <Icon name={one} />
          {t(`planning.tool.${one}`)} <kbd>{kKeyOfTool[one].toUpperCase()}</kbd>
        </button>
      ))}
      <button type="button" class="button" onClick={() => table.send({ hold: { duration_s: kHold_s } })} title="H">
        <Icon name="clock" />
        {t('planning.hold', { s: kHold_s })} <kbd>H</kbd>
      </button>
      <button type="button" class="button" onClick={() => table.lookFrom(kFirstView)}>
        <Icon name="fit" />
        {t('planning.front')}
      </button>
      {tool === 'press' && <Depth label={t('planning.depth')} most_mm={40} at_m={table.depth_m.value} set={(depth_m) => table.setDepth(depth_m)} />}
      {tool === 'cut' && !held && (
        <Depth
          key="cut"
          label={t('planning.cutDepth')}
          most_mm={1000 * kMostDepth_m}
          at_m={table.cutDepth_m.value}
          set={(depth_m) => (table.cutDepth_m.value = depth_m)}
        />
      )}
      {tool === 'cut' && held && chosen && (
        <Depth
          key="handle"
          label={t('planning.handleDepth', { n: chosen.handle + 1 })}
          most_mm={1000 * kMostDepth_m}
          at_m={held.depth_m}
          set={(depth_m) => table.setHandleDepth(depth_m)}
          done={() => table.finishDepth()}
          putBack={() => table.putHandleBack()}
        />
      )}
    </div>
  );
}
