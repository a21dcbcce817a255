// The streams of a room: whether each delivers, in which form its pictures are archived, what was lost.
import type { Profile, RoomStatus, StreamStatus } from '@/api/types';
import { t, word } from '@/i18n/i18n';
import { isSilent } from '@/rooms/trouble';
import { Icon } from '@/shell/icon';

const kProfiles: readonly Profile[] = ['mpeg2', 'lossless', 'uncompressed'];

function Form({ stream, onArchiveAs }: { stream: StreamStatus; onArchiveAs: Props['onArchiveAs'] }) {
  const form = stream.profile_to_come || stream.profile;
  if (!onArchiveAs) return <>{word('profile', form)}</>;
  return (
    <select
      aria-label={t('rooms.archiveAs', { name: word('stream', stream.name) })}
      value={form}
      onChange={(event) => {
        const asked = kProfiles.find((one) => one === event.currentTarget.value);
        // What is archived is what the recorder says.
        event.currentTarget.value = form;
        if (asked) onArchiveAs(stream.name, asked);
      }}
    >
      {kProfiles.map((one) => (
        <option key={one} value={one}>
          {word('profile', one)}
        </option>
      ))}
    </select>
  );
}

interface Props {
  room: RoomStatus;
  /** Where the person who looks may change it. */
  onArchiveAs: ((stream: string, profile: Profile) => void) | undefined;
}

export function StreamTable({ room, onArchiveAs }: Props) {
  return (
    <table class="table stream-table">
      <thead>
        <tr>
          <th scope="col">{t('rooms.stream')}</th>
          <th scope="col">{t('rooms.signal')}</th>
          <th scope="col">{t('rooms.archivedAs')}</th>
          <th scope="col" class="number">
            {t('rooms.frames')}
          </th>
          <th scope="col" class="number">
            {t('rooms.lost')}
          </th>
          <th scope="col" class="number">
            {t('rooms.safe')}
          </th>
        </tr>
      </thead>
      <tbody>
        {room.streams.map((one) => {
          const well = !isSilent(one);
          return (
            <tr key={one.name}>
              <th scope="row">{word('stream', one.name)}</th>
              <td>
                <span class={well ? 'state state-good' : 'state state-bad'}>
                  <Icon name={well ? 'check' : 'alarm'} />
                  {well ? t('rooms.live') : t('rooms.silent')}
                </span>
              </td>
              <td>{one.kind === 'video' && <Form stream={one} onArchiveAs={onArchiveAs} />}</td>
              <td class="number">{one.frames}</td>
              <td class={one.dropped > 0 ? 'number state-bad' : 'number'}>{one.dropped}</td>
              <td class="number">{(one.durable_age_ms / 1000).toFixed(1)} s</td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}
