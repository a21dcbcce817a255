import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';

/** Whether anybody can see the page. */
export function useVisible(): boolean {
  const visible = useSignal(document.visibilityState === 'visible');
  useEffect(() => {
    const changed = () => (visible.value = document.visibilityState === 'visible');
    document.addEventListener('visibilitychange', changed);
    return () => document.removeEventListener('visibilitychange', changed);
  }, []);
  return visible.value;
}
