// What an organ to push aside is called on the page.
import { t } from '@/i18n/i18n';

/** Objects A, B and C in the page's language, a patient's organ by its own name. */
export const objectLabel = (object: string): string => (object === 'a' || object === 'b' || object === 'c' ? t(`object.${object}`) : object);
