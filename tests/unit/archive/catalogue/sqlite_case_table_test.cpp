#include "archive/catalogue/sqlite_case_table.h"

#include "tests/support/case_table_suite.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

class InSqlite : public testing::Test {
 protected:
  std::unique_ptr<CaseTable> open() const {
    return std::make_unique<SqliteCaseTable>(folder_ / "catalogue.sqlite");
  }

 private:
  test::TemporaryFolder folder_;
};
INSTANTIATE_TYPED_TEST_SUITE_P(Sqlite, CaseTableSuite, InSqlite);

}  // namespace
}  // namespace kiroku::archive
