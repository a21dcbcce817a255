#include "timestamp/authority.h"
#include "timestamp/client.h"

namespace kiroku::timestamp {
namespace {

class EmbeddedStampSource final : public StampSource {
 public:
  explicit EmbeddedStampSource(Authority& authority) : authority_(authority) {}
  Bytes ask(ByteView query) override { return authority_.respond(query); }

 private:
  Authority& authority_;
};

}  // namespace

std::unique_ptr<StampSource> embedded_stamp_source(Authority& authority) {
  return std::make_unique<EmbeddedStampSource>(authority);
}

}  // namespace kiroku::timestamp
