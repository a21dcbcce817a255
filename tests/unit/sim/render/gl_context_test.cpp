#include "sim/render/gl_context.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

TEST(GlContext, IsThereInSoftware) {
  const auto context = make_software_context();
  EXPECT_TRUE(context->is_software());
  EXPECT_THAT(context->renderer(), HasSubstr("pipe"));
  GLint blocks = 0;
  context->gl().GetIntegerv(GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS, &blocks);
  EXPECT_GE(blocks, 4);
  EXPECT_NO_THROW(check_gl(context->gl(), "do nothing"));
}

TEST(GlContext, SaysWhatFailed) {
  const auto context = make_software_context();
  context->gl().Enable(0xFFFF);
  try {
    check_gl(context->gl(), "draw");
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "cannot draw: OpenGL refused a call (error 1280)");
  }
  EXPECT_NO_THROW(check_gl(context->gl(), "draw")) << "told once";
}

TEST(GlContext, NamesTheFunctionThatADriverLacks) {
  int something = 0;
  try {
    load_gl(
        [&](const char* name) {
          return std::string_view(name) == "glViewport" ? nullptr : static_cast<void*>(&something);
        },
        "libOld.so");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("libOld.so lacks glViewport"));
  }
}

TEST(GlContext, GoesOnInSoftwareWhereTheGraphicsProcessorFailsAndSaysSo) {
  const ChosenContext chosen = choose_context(
      GpuUse::kAuto, []() -> std::unique_ptr<GlContext> { throw Error("its device is on fire"); });
  EXPECT_TRUE(chosen.context->is_software());
  EXPECT_THAT(chosen.notice, HasSubstr("in software: its device is on fire"));
}

TEST(GlContext, DoesNotLookForAGraphicsProcessorWhereItIsToldNotTo) {
  bool asked = false;
  const GpuMaker maker = [&]() -> std::unique_ptr<GlContext> {
    asked = true;
    return nullptr;
  };
  EXPECT_TRUE(choose_context(GpuUse::kOff, maker).context->is_software());
  EXPECT_FALSE(asked);
  const ChosenContext chosen = choose_context(GpuUse::kAuto, maker);
  EXPECT_TRUE(asked);
  EXPECT_TRUE(chosen.context->is_software());
  EXPECT_EQ(chosen.notice, "") << "there is none, so nothing failed";
}

}  // namespace
}  // namespace kiroku::sim
