// The parts beside the picture: tools at the organ with their forces, the steps, saving.
import { typed } from '@/base/form_fields';
import { t, word } from '@/i18n/i18n';
import type { Step, ToolState } from '@/planning/planning_api';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';

/** Of the bars: what a fingertip rarely exceeds. */
const kMostForce_n = 10;

function Jaws({ tool, close }: { tool: ToolState; close: (tool: string, opens: boolean) => void }) {
  if (!tool.jaws) return null;
  const { opening_m, squeeze_n, pull_n, most_pull_n, slipped_m, slips, left } = tool.jaws;
  const numbers = { apart: (1000 * opening_m).toFixed(1), squeeze: squeeze_n.toFixed(2), pull: pull_n.toFixed(2), most: most_pull_n.toFixed(2) };
  if (left) {
    return (
      <div class="planning-jaws">
        <span class="muted">{t('planning.clipLeft', numbers)}</span>
      </div>
    );
  }
  return (
    <div class="planning-jaws">
      <button type="button" class="button button-quiet" onClick={() => close(tool.name, false)} aria-label={t('planning.closeOf', { tool: tool.name })}>
        {t('planning.jawsClose')} <kbd>−</kbd>
      </button>
      <button type="button" class="button button-quiet" onClick={() => close(tool.name, true)} aria-label={t('planning.openJawsOf', { tool: tool.name })}>
        {t('planning.jawsOpen')} <kbd>+</kbd>
      </button>
      <span class="muted">{t('planning.jaws', numbers)}</span>
      {slips && (
        <strong class="planning-slips" role="status">
          {t('planning.slips', { by: (1000 * slipped_m).toFixed(1) })}
        </strong>
      )}
    </div>
  );
}

interface Forces {
  tools: readonly ToolState[];
  release: (tool: string) => void;
  close: (tool: string, opens: boolean) => void;
}

export function ForceList({ tools, release, close }: Forces) {
  return (
    <section class="card planning-tools" aria-label={t('planning.forces')}>
      <h2>{t('planning.forces')}</h2>
      {tools.length === 0 && <p class="muted">{t('planning.noTools')}</p>}
      {tools.map((tool) => (
        <div class="planning-tool" key={tool.name}>
          <span>{tool.name}</span>
          <progress class="force-bar" max={kMostForce_n} value={Math.min(tool.force_n, kMostForce_n)} aria-label={tool.name} />
          <span class="mono">{tool.force_n.toFixed(2)}</span>
          {!tool.jaws?.left && (
            <button
              type="button"
              class="button button-quiet"
              onClick={() => release(tool.name)}
              aria-label={t(tool.kind === 'clip' ? 'planning.leaveClipOf' : 'planning.releaseOf', { tool: tool.name })}
            >
              {t(tool.kind === 'clip' ? 'planning.leaveClip' : 'planning.release')}
            </button>
          )}
          <Jaws tool={tool} close={close} />
        </div>
      ))}
    </section>
  );
}

export function StepList({ steps }: { steps: readonly Step[] }) {
  let begins_s = 0;
  return (
    <section class="card planning-steps" aria-label={t('planning.steps')}>
      <h2>{t('planning.stepsCount', { n: steps.length })}</h2>
      <ol tabIndex={0} aria-label={t('planning.steps')}>
        {steps.map((step, i) => {
          const at_s = begins_s;
          begins_s += step.duration_s;
          return (
            <li key={i}>
              <span class="mono muted">{at_s.toFixed(1)} s</span> {step.name || word('planning.did', step.action)} {step.tools.join(', ')}
              {step.duration_s > 0 && <span class="muted"> · {step.duration_s.toFixed(1)} s</span>}
            </li>
          );
        })}
      </ol>
    </section>
  );
}

export function SaveDialog({ name, file, save, close }: { name: string; file: string; save: (file: string, name: string) => void; close: () => void }) {
  return (
    <Dialog title={t('planning.save')} onClose={close}>
      <form
        class="form"
        method="dialog"
        onSubmit={(event) => {
          const fields = new FormData(event.currentTarget);
          save(typed(fields, 'file').trim(), typed(fields, 'name').trim());
        }}
      >
        <label class="field">
          <span>{t('planning.saveFile')}</span>
          <input name="file" required maxLength={100} defaultValue={file} autocomplete="off" />
        </label>
        <label class="field">
          <span>{t('planning.saveName')}</span>
          <input name="name" required maxLength={200} defaultValue={name} autocomplete="off" />
        </label>
        <p class="muted">{t('planning.saveWhat')}</p>
        <button type="submit" class="button button-main">
          <Icon name="save" />
          {t('planning.saveDo')}
        </button>
      </form>
    </Dialog>
  );
}
