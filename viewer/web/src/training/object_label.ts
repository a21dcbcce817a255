// What an organ to push aside is called on the page.
import { t } from '@/i18n/i18n';

/** Objects A and B in the page's language, a patient's organ by its own name. */
export const objectLabel = (object: string): string => (object === 'a' || object === 'b' ? t(`object.${object}`) : object);
