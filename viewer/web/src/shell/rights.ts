// What the page offers to whom. The server decides (viewer/http/role.cpp); a test compares the two.
import type { Role } from '@/api/types';

export type Right =
  'read-case' | 'watch' | 'compare' | 'plan' | 'train' | 'verify' | 'read-log' | 'see-live' | 'watch-room' | 'control-rooms' | 'invite' | 'manage-users';

const kWho: Record<Right, readonly Role[]> = {
  'read-case': ['surgeon', 'auditor', 'administrator'],
  watch: ['surgeon', 'administrator'],
  compare: ['surgeon', 'administrator'],
  plan: ['surgeon', 'administrator'],
  train: ['operator', 'surgeon', 'auditor', 'administrator'],
  verify: ['surgeon', 'auditor', 'administrator'],
  'read-log': ['auditor', 'administrator'],
  'see-live': ['operator', 'surgeon', 'administrator'],
  'watch-room': ['operator', 'surgeon', 'administrator'],
  'control-rooms': ['operator', 'surgeon', 'administrator'],
  invite: ['surgeon', 'administrator'],
  'manage-users': ['administrator'],
};

export const kRights = Object.keys(kWho) as Right[];

/** A guest has a page of their own, and is offered nothing of this. */
export const may = (role: Role | 'guest' | undefined, right: Right): boolean => role !== undefined && role !== 'guest' && kWho[right].includes(role);
