import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { Company } from '@/pointing/company';

/** The connection to those who look on in a room, while `looks`. */
export function useCompany(room: string, looks: boolean): Company | undefined {
  const company = useSignal<Company | undefined>(undefined);
  useEffect(() => {
    if (!looks) return;
    const one = new Company(room);
    company.value = one;
    return () => {
      one.close();
      company.value = undefined;
    };
  }, [room, looks]);
  return company.value;
}
