// A program of its own, as it counts what all its code asks of the allocator and of locks: the force loop
// asks for nothing.
//
// Real time: the loop runs by the machine's clock, a thousand times a second, and is counted while it does.
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <dlfcn.h>
#include <memory>
#include <mutex>
#include <pthread.h>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "sim/fem/background_thread.h"
#include "sim/haptics/force_loop.h"
#include "sim/haptics/haptic_contact.h"
#include "sim/haptics/simulated_hand.h"
#include "tests/support/tet_cylinder.h"

namespace {

/// Of the calling thread, so far.
struct Asked {
  std::uint64_t allocations = 0, frees = 0, locks = 0;
};
thread_local Asked asked;

}  // namespace

// The allocator's own functions, counted.
// NOLINTBEGIN(readability-identifier-naming,bugprone-reserved-identifier)
extern "C" {
void* __libc_malloc(std::size_t bytes);
void* __libc_calloc(std::size_t count, std::size_t bytes);
void* __libc_realloc(void* memory, std::size_t bytes);
void* __libc_memalign(std::size_t alignment, std::size_t bytes);
void __libc_free(void* memory);

void* malloc(std::size_t bytes) {
  ++asked.allocations;
  return __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) {
  ++asked.allocations;
  return __libc_calloc(count, bytes);
}
void* realloc(void* memory, std::size_t bytes) {
  ++asked.allocations;
  return __libc_realloc(memory, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  ++asked.allocations;
  return __libc_memalign(alignment, bytes);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t bytes) {
  ++asked.allocations;
  *memory = __libc_memalign(alignment, bytes);
  return *memory == nullptr ? ENOMEM : 0;
}
void free(void* memory) {
  if (memory != nullptr) ++asked.frees;
  __libc_free(memory);
}
int pthread_mutex_lock(pthread_mutex_t* mutex) {
  using Lock = int (*)(pthread_mutex_t*);
  static const auto next = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  ++asked.locks;
  return next(mutex);
}
}
// NOLINTEND(readability-identifier-naming,bugprone-reserved-identifier)

namespace kiroku::sim {
namespace {

using namespace std::chrono_literals;

ElasticBody held_cylinder() {
  TetMesh mesh = test::tet_cylinder(5, 10, 0.03, 0.1);
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
  }
  return {std::move(mesh), {{0, {1e4, 0.4}}}, constraints};
}

/// Passes on to another source and keeps what its thread had asked for when.
class CountedForces : public ForceSource {
 public:
  explicit CountedForces(ForceSource& source) : source_(source) {}
  /// What is asked for from the next step on is told of.
  void be_warm() { warm_ = true; }
  void forces(std::span<const Pose> poses, double period_s, std::span<Vector3> forces_n) override {
    source_.forces(poses, period_s, forces_n);
    ++steps_;
    if (warm_ && !counts_) {
      counts_ = true;
      first_ = asked;
    }
    felt_ = felt_ || forces_n[0].norm() > 0;
    last_ = asked;
  }
  [[nodiscard]] std::uint64_t steps() const { return steps_; }
  // Of the loop's thread, once that has ended.
  [[nodiscard]] bool felt() const { return felt_; }
  [[nodiscard]] Asked since_warm() const {
    return {last_.allocations - first_.allocations, last_.frees - first_.frees, last_.locks - first_.locks};
  }

 private:
  ForceSource& source_;
  std::atomic<bool> warm_ = false;
  std::atomic<std::uint64_t> steps_ = 0;
  bool counts_ = false;
  Asked first_, last_;
  bool felt_ = false;
};

TEST(RealTime, CountsWhatAThreadAsksFor) {
  std::mutex mutex;
  { const std::lock_guard lock(mutex); }  // the first looks the real one up
  const Asked before = asked;
  { const std::lock_guard lock(mutex); }
  auto number = std::make_unique<int>(3);
  Eigen::VectorXd vector = Eigen::VectorXd::Zero(100);
  const std::string long_text(static_cast<std::size_t>(*number) * 100, 'x');
  number.reset();
  vector.resize(0);
  const Asked after = asked;
  EXPECT_EQ(after.allocations, before.allocations + 3);
  EXPECT_GE(after.frees, before.frees + 2);
  EXPECT_EQ(after.locks, before.locks + 1);
}

TEST(RealTime, TheForceLoopNeitherAllocatesNorFreesNorLocks) {
  const ElasticBody body = held_cylinder();
  // Columns come on demand, so that the neighbourhood changes while the loop runs.
  ComplianceOptions little;
  little.memory_bytes = std::size_t{4} << 20;
  const ContactBody contact(body, {}, little);
  constexpr double kPeriodSeconds = 1e-3, kTurnSeconds = 0.2;
  std::vector<SimulatedHand::Path> paths;
  for (const double side : {1.0, -1.0}) {
    paths.emplace_back([side](double time_s) {
      const double turn = 2 * 3.14159265358979 * time_s / kTurnSeconds;
      Pose pose;
      pose.position_m = {side * (0.0385 - 0.002 * std::sin(turn)), 0.003 * std::sin(2 * turn),
                         0.06 + 0.02 * std::sin(turn)};
      return pose;
    });
  }
  HapticContact forces(contact, {{"a", Sphere{0.01}, false}, {"b", Sphere{0.01}, true}});
  CountedForces counted(forces);
  SimulatedHand hand(paths, kPeriodSeconds);
  ForceLoop loop(hand, counted);
  std::size_t neighbourhoods = 0, known = 0;
  // Three turns, with as many looks at the neighbourhood as an idle machine has time for: then there is room
  // for all contacts.
  constexpr std::uint64_t kWarmSteps = 600, kCountedSteps = 1400;
  constexpr std::size_t kWarmLooks = 60;
  std::uint64_t counted_from = 0;
  const auto patience = std::chrono::steady_clock::now() + 100s;
  for (std::size_t looks = 0; std::chrono::steady_clock::now() < patience; ++looks) {
    if (counted_from == 0 && counted.steps() >= kWarmSteps && looks >= kWarmLooks) {
      counted_from = counted.steps();
      counted.be_warm();
    }
    if (counted_from > 0 && counted.steps() >= counted_from + kCountedSteps) break;
    const std::size_t now = forces.refresh().nodes_known;
    if (now != known) ++neighbourhoods;
    known = now;
    std::this_thread::sleep_for(5ms);
  }
  loop.stop();
  ASSERT_GT(counted_from, 0U);
  ASSERT_GE(counted.steps(), counted_from + kCountedSteps);
  EXPECT_TRUE(counted.felt());
  EXPECT_GT(neighbourhoods, 1U);
  EXPECT_EQ(counted.since_warm().allocations, 0U);
  EXPECT_EQ(counted.since_warm().frees, 0U);
  EXPECT_EQ(counted.since_warm().locks, 0U);
}

TEST(RealTime, AnotherNeighbourhoodHasTheRoomThatWasNeededBefore) {
  const ElasticBody body = held_cylinder();
  const ContactBody contact(body);
  const std::vector<ContactTool> tools{{"plate", Box{{0.1, 0.1, 0.01}}, true}};
  ContactSolver solver(contact.whole_surface(), tools), next(contact.whole_surface(), tools);
  std::vector<Pose> poses(1);
  poses[0].position_m = {0, 0, 0.109};
  const std::size_t usual = next.room(), contacts = solver.step(poses).contacts.size();
  ASSERT_GT(contacts, usual);
  ASSERT_GE(solver.room(), contacts);
  next.reserve(solver.room());
  const Asked before = asked;
  next.continue_from(solver);
  next.step(poses);
  const Asked after = asked;
  EXPECT_EQ(next.result().contacts.size(), contacts);
  EXPECT_EQ(after.allocations, before.allocations);
  EXPECT_EQ(after.frees, before.frees);
}

TEST(RealTime, AThreadInTheBackgroundGivesWay) {
  std::thread([] {
    ASSERT_TRUE(work_in_background());
    int policy = -1;
    sched_param parameters{};
    ASSERT_EQ(::pthread_getschedparam(::pthread_self(), &policy, &parameters), 0);
    EXPECT_EQ(policy, SCHED_BATCH);
  }).join();
}

}  // namespace
}  // namespace kiroku::sim
