// Every text of the page, from a file for each view. The Japanese has the same keys and the same places in braces; a test sees to it.

import { breathingEn, breathingJa } from '@/i18n/breathing_messages';
import { caseEn, caseJa } from '@/i18n/case_messages';
import { casesEn, casesJa } from '@/i18n/cases_messages';
import { consentEn, consentJa } from '@/i18n/consent_messages';
import { fleetEn, fleetJa } from '@/i18n/fleet_messages';
import { guestEn, guestJa } from '@/i18n/guest_messages';
import { logEn, logJa } from '@/i18n/log_messages';
import { matchEn, matchJa } from '@/i18n/match_messages';
import { organEn, organJa } from '@/i18n/organ_messages';
import { pickEn, pickJa } from '@/i18n/pick_messages';
import { placeEn, placeJa } from '@/i18n/place_messages';
import { planEn, planJa } from '@/i18n/plan_messages';
import { planningEn, planningJa } from '@/i18n/planning_messages';
import { pointingEn, pointingJa } from '@/i18n/pointing_messages';
import { roomsEn, roomsJa } from '@/i18n/rooms_messages';
import { shellEn, shellJa } from '@/i18n/shell_messages';
import { stateEn, stateJa } from '@/i18n/state_messages';
import { subjectEn, subjectJa } from '@/i18n/subject_messages';
import { timelineEn, timelineJa } from '@/i18n/timeline_messages';
import { trainingEn, trainingJa } from '@/i18n/training_messages';
import { usersEn, usersJa } from '@/i18n/users_messages';
import { verificationEn, verificationJa } from '@/i18n/verification_messages';

const en = {
  ...shellEn,
  ...stateEn,
  ...placeEn,
  ...casesEn,
  ...fleetEn,
  ...verificationEn,
  ...caseEn,
  ...consentEn,
  ...planEn,
  ...matchEn,
  ...organEn,
  ...pickEn,
  ...subjectEn,
  ...timelineEn,
  ...roomsEn,
  ...usersEn,
  ...guestEn,
  ...pointingEn,
  ...logEn,
  ...planningEn,
  ...breathingEn,
  ...trainingEn,
} as const;

export type MessageKey = keyof typeof en;
export type Language = 'en' | 'ja';

const ja: Record<MessageKey, string> = {
  ...shellJa,
  ...stateJa,
  ...placeJa,
  ...casesJa,
  ...fleetJa,
  ...verificationJa,
  ...caseJa,
  ...consentJa,
  ...planJa,
  ...matchJa,
  ...organJa,
  ...pickJa,
  ...subjectJa,
  ...timelineJa,
  ...roomsJa,
  ...usersJa,
  ...guestJa,
  ...pointingJa,
  ...logJa,
  ...planningJa,
  ...breathingJa,
  ...trainingJa,
};

export const messages: Record<Language, Record<MessageKey, string>> = { en, ja };
