// The command line on processors older than this one.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

class Processors : public testing::Test {
 protected:
  /// The trammel program on a processor that has no vectors beyond `vectors`.
  static test::Finished run(const std::string& vectors, std::vector<std::string> words) {
    words.insert(words.begin(), {"/usr/bin/env", "TRAMMEL_NUMERICS=" + vectors, kProgram});
    test::Finished finished = test::run(words, std::chrono::minutes(2));
    EXPECT_EQ(finished.exit_code, 0) << finished.err;
    return finished;
  }
  static constexpr const char* kProgram = TRAMMEL_BINARY_DIR "/clients/trammel";
  static constexpr const char* kCell = TRAMMEL_SOURCE_DIR "/config/cell-7.yaml";
  static constexpr const char* kTruth = TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml";
  test::TemporaryFolder folder_;
};

TEST_F(Processors, EachTrainsAModelThatIsAsGood) {
  const std::string plan = folder_.file("plan.csv"), batch = folder_.file("batch.csv");
  run("", {"plan", "--cell", kCell, "--count", "100", "-o", plan});
  run("", {"simulate", "--cell", kCell, "--truth", kTruth, "--plan", plan, "-o", batch});
  std::vector<double> left_mm;
  for (const char* vectors : {"baseline", "avx2", "avx512"}) {
    const std::string model = folder_.file(std::string(vectors) + ".model");
    run(vectors, {"train", "--cell", kCell, "--batch", batch, "--level", "M2", "--bias", "se", "-o", model});
    const auto evaluated =
        nlohmann::json::parse(run(vectors, {"evaluate", "--model", model, "--batch", batch, "--json", "-"}).out);
    left_mm.push_back(evaluated.at("rms_mm").get<double>());
  }
  EXPECT_GT(left_mm[0], 0);
  EXPECT_NEAR(left_mm[1], left_mm[0], 1e-4);
  EXPECT_NEAR(left_mm[2], left_mm[0], 1e-4);
}

}  // namespace
}  // namespace trammel
