#include "sim/meshing/organs.h"

#include <algorithm>

#include "base/error.h"

namespace kiroku::sim {

const std::vector<Organ>& known_organs() {
  static const std::vector<Organ> organs{
      {"spleen", {1, 1}},      {"right-kidney", {2, 2}}, {"left-kidney", {3, 3}},  {"gallbladder", {4, 4}},
      {"liver", {5, 5}},       {"stomach", {6, 6}},      {"pancreas", {7, 7}},     {"lung", {10, 14}, 2},
      {"left-lung", {10, 11}}, {"right-lung", {12, 14}}, {"oesophagus", {15, 15}}, {"trachea", {16, 16}},
      {"bladder", {21, 21}},   {"heart", {51, 51}},      {"aorta", {52, 52}},      {"ribs", {92, 115}, 24}};
  return organs;
}

const Organ& organ_named(std::string_view name) {
  const auto found = std::ranges::find(known_organs(), name, &Organ::name);
  if (found != known_organs().end()) return *found;
  std::string names;
  for (const Organ& organ : known_organs()) names += (names.empty() ? "" : ", ") + std::string(organ.name);
  throw UsageError("no organ is called '" + std::string(name) + "'; there are " + names);
}

}  // namespace kiroku::sim
