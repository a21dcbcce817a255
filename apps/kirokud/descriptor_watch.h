// How many files and connections kirokud may have open, and telling when they become few.
#pragma once

namespace kiroku::apps {

/// Started by hand it has a shell's limit, which the viewer's connections alone reach: raises it as far as it
/// goes, and warns where that is little.
void allow_many_descriptors();

/// Tells when descriptors become few, and when they are no longer. Of one thread.
class DescriptorWatch {
 public:
  void look();

 private:
  bool are_few_ = false;
};

}  // namespace kiroku::apps
