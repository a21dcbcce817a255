// What the page offers to whom. The server decides (viewer/server/role.cpp); a test compares the two.
import type { Role } from '@/api/types';

export type Right = 'read-case' | 'watch' | 'compare' | 'verify' | 'see-live' | 'control-rooms' | 'manage-users';

const kWho: Record<Right, readonly Role[]> = {
  'read-case': ['surgeon', 'auditor', 'administrator'],
  watch: ['surgeon', 'administrator'],
  compare: ['surgeon', 'administrator'],
  verify: ['surgeon', 'auditor', 'administrator'],
  'see-live': ['operator', 'surgeon', 'administrator'],
  'control-rooms': ['operator', 'surgeon', 'administrator'],
  'manage-users': ['administrator'],
};

export const kRights = Object.keys(kWho) as Right[];

export const may = (role: Role | undefined, right: Right): boolean => role !== undefined && kWho[right].includes(role);
