#include "sim/haptics/haptic_contact.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "sim/contact/near_tools.h"

namespace kiroku::sim {

void HapticContact::Fade::begin(const Felt& before, const Felt& after) {
  for (std::size_t tool = 0; tool < difference_.forces_n.size(); ++tool) {
    difference_.forces_n[tool] = before.forces_n[tool] - after.forces_n[tool];
    difference_.torques_nm[tool] = before.torques_nm[tool] - after.torques_nm[tool];
  }
  left_s_ = fade_s_;
}

void HapticContact::Fade::apply(double period_s, Felt& felt) {
  if (left_s_ <= 0) return;
  for (std::size_t tool = 0; tool < difference_.forces_n.size(); ++tool) {
    felt.forces_n[tool] += left_s_ / fade_s_ * difference_.forces_n[tool];
    felt.torques_nm[tool] += left_s_ / fade_s_ * difference_.torques_nm[tool];
  }
  left_s_ -= period_s;
}

HapticContact::HapticContact(const ContactBody& body, std::vector<ContactTool> tools,
                             const HapticContactOptions& options)
    : body_(body),
      options_(options),
      tools_(std::move(tools)),
      whole_(body.compliance().complete() && body.surface().size() <= kWholeSurface),
      size_m_(extent_of(body.body().mesh()).longest_side_m()),
      solver_(std::make_unique<ContactSolver>(whole_ ? body.whole_surface() : body.neighbourhood({}), tools_,
                                              options.contact)),
      last_(tools_.size()),
      found_(tools_.size()),
      last_poses_(tools_.size()),
      fade_(tools_.size(), std::chrono::duration<double>(options.fade).count()),
      near_(body.surface().size()),
      known_(body.surface().size()),
      ahead_(body.surface().size()),
      tree_(body.surface().size()),
      poses_(tools_.size()) {
  if (!(options_.margin > 0)) throw UsageError("the margin around tools must be greater than zero");
  if (options_.fade.count() <= 0) throw UsageError("forces need a time to fade in");
  constexpr std::size_t kUsualContacts = 1024;
  contacts_.reserve(kUsualContacts);
}

bool HapticContact::solve(std::span<const Pose> poses, Felt& felt) {
  try {
    const ContactResult& result = solver_->step(poses);
    for (std::size_t tool = 0; tool < result.tools.size(); ++tool) {
      felt.forces_n[tool] = result.tools[tool].force_n;
      felt.torques_nm[tool] = result.tools[tool].torque_nm;
    }
    return true;
  } catch (const UsageError&) {
    throw;  // another number of tools than the device has: no step would ever succeed
  } catch (const Error&) {
    ++failed_;
    return false;
  }
}

void HapticContact::forces(std::span<const Pose> poses, double period_s, std::span<Vector3> forces_n) {
  if (solve(poses, found_)) {
    fade_.apply(period_s, found_);
    std::swap(last_, found_);
    std::ranges::copy(poses, last_poses_.begin());
  }
  std::ranges::copy(last_.forces_n, forces_n.begin());
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return;
  if (next_ && !used_) {
    const bool as_before = next_->continue_from(*solver_);
    std::swap(solver_, next_);
    used_ = std::move(next_);  // freed by refresh()
    // What the new one finds at the same poses is where forces have to come to, from where they are. On a
    // compliance that no cache holds yet that takes longer than a step: only where forces will differ.
    if (!as_before && solve(poses, found_)) fade_.begin(last_, found_);
  }
  contacts_ = solver_->result().contacts;
  poses_.assign(poses.begin(), poses.end());
  has_poses_ = true;
  failed_seen_ = failed_;
  room_ = solver_->room();
}

WristForce HapticContact::wrist_force(const Vector3& wrist_m) {
  return wrist_force_of(wrist_m, last_poses_, last_.forces_n, last_.torques_nm);
}

WristForce HapticContact::tool_force(std::size_t tool, const Vector3& about_m) const {
  return wrist_force_of(about_m, std::span(last_poses_).subspan(tool, 1),
                        std::span(last_.forces_n).subspan(tool, 1),
                        std::span(last_.torques_nm).subspan(tool, 1));
}

HapticContact::Deformation HapticContact::refresh() {
  Deformation found;
  std::vector<Pose> poses;
  std::unique_ptr<ContactSolver> used;
  std::size_t room = 0;
  {
    const std::lock_guard lock(mutex_);
    room = room_;
    found.contacts = contacts_;
    found.steps_failed = failed_seen_;
    if (has_poses_) poses = poses_;
    used = std::move(used_);
  }
  used.reset();
  body_.displacement_m(found.contacts, found.displacement_m);
  if (whole_) {
    found.nodes_known = body_.surface().size();
    return found;
  }
  const auto count_known = [&] { return static_cast<std::size_t>(std::ranges::count(known_, 1)); };
  found.nodes_known = count_known();
  if (poses.empty()) return found;

  positions_m_.resize(static_cast<Eigen::Index>(3 * body_.surface().size()));
  for (std::size_t place = 0; place < body_.surface().size(); ++place) {
    const std::uint32_t node = body_.surface()[place];
    positions_m_.segment<3>(static_cast<Eigen::Index>(3 * place)) =
        body_.body().mesh().nodes[node] +
        found.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{node}));
  }
  tree_.refit(positions_m_);
  const double margin_m = options_.margin * size_m_;
  std::ranges::fill(near_, 0);
  mark_near(tree_, positions_m_, tools_, poses, margin_m, near_);
  for (const Contact& contact : found.contacts) near_[body_.place_of(contact.node)] = 1;
  ahead_ = near_;
  mark_near(tree_, positions_m_, tools_, poses, 2 * margin_m, ahead_);

  // Near ones first, then those ahead.
  std::vector<std::uint32_t> places, fetched;
  for (std::uint32_t place = 0; place < near_.size(); ++place) {
    if (near_[place] == 0) continue;
    if (body_.compliance().available(body_.surface()[place])) {
      places.push_back(place);
    } else {
      fetched.push_back(body_.surface()[place]);
    }
  }
  found.nodes_awaited = fetched.size();
  for (std::uint32_t place = 0; place < ahead_.size(); ++place) {
    if (ahead_[place] != 0 && near_[place] == 0) fetched.push_back(body_.surface()[place]);
  }
  body_.compliance().prefetch(fetched);

  std::vector<std::uint8_t> next_known(known_.size());
  for (const std::uint32_t place : places) next_known[place] = 1;
  // As long as all that is near is known, what is no longer near does no harm.
  const bool more = std::ranges::any_of(places, [&](std::uint32_t place) { return known_[place] == 0; });
  if (!more) return found;
  auto next = std::make_unique<ContactSolver>(body_.neighbourhood(places), tools_, options_.contact);
  next->reserve(room);  // or the force loop would ask for it, and wait for this thread in the allocator
  known_ = std::move(next_known);
  found.nodes_known = count_known();
  {
    const std::lock_guard lock(mutex_);
    std::swap(next_, next);  // one that the force loop has not come to yet is freed here
  }
  return found;
}

}  // namespace kiroku::sim
