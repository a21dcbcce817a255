#include "trainer/haptic_rate/rate_budget.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

TEST(RateBudget, MeasuresForcesAloneAndWithTheRestOfTheWork) {
  const Plate plate;
  sim::SurfaceRenderer renderer(plate.body().mesh(), sim::GpuUse::kOff);
  const RateBudget found = measure_budget(plate, renderer, 2, 8.8, std::chrono::milliseconds(600));
  EXPECT_EQ(found.fingers, 2U);
  EXPECT_GT(found.force_ms, 0);
  EXPECT_NEAR(found.achievable_hz * found.force_ms, 1000, 1e-6);
  EXPECT_GE(found.schedule.forces.times, 2U);
  EXPECT_LE(found.schedule.forces.times, 7U);  // 8.8 Hz for 0.6 s
  EXPECT_GT(found.schedule.deformation.times + found.schedule.pictures.times, 0U);
  EXPECT_EQ(exclusion_required_hz(1), 15.8);
  EXPECT_EQ(exclusion_required_hz(2), 4.2);
  EXPECT_NEAR(exclusion_required_hz(5), 4.2 / 27, 1e-12);
  EXPECT_THROW((void)exclusion_required_hz(6), UsageError);
  EXPECT_EQ(paper_force_ms(5), 29.7);
  EXPECT_THROW((void)paper_force_ms(6), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
