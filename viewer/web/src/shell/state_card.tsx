// Where nothing can be shown: what is the matter, what to do about it, and the ways on.
import type { ComponentChildren } from 'preact';
import { Icon, type IconName } from '@/shell/icon';

interface Props {
  icon: IconName;
  title: string;
  /** What to do. */
  what?: string;
  /** The server's own words, where it said why. */
  why?: string | undefined;
  /** Buttons and links. */
  children?: ComponentChildren;
}

export function StateCard({ icon, title, what, why, children }: Props) {
  return (
    <div class="empty card state-card" role="status">
      <Icon name={icon} />
      <h2>{title}</h2>
      {why !== undefined && why !== '' && <p class="state-why">{why}</p>}
      {what !== undefined && <p>{what}</p>}
      {children && <div class="state-ways">{children}</div>}
    </div>
  );
}
