#include "server/compensate/model_file.h"

#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "tests/support/demand.h"
#include "tests/support/refusal.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

using nlohmann::json;

/// A model of a base, as a file has it.
const std::string& small_model_text() {
  static const std::string text = [] {
    const auto cell = test::small_cell("cell-1");
    CompensatedModel::Parts parts = test::nominal_model(cell, 40).parts();
    parts.physics = test::demand(make_physical_model(cell, {"base"}));
    const auto P = parts.physics.values.size();
    parts.covariance = Eigen::MatrixXd::Identity(P, P) * 1e-8;
    for (const Parameter& p : parts.physics.parameters())
      parts.parameters.push_back({p, 0.0, 1e-4, true});
    parts.rank = static_cast<int>(P);
    parts.provenance.trained_at = 1'700'000'000;
    return serialize(test::demand(CompensatedModel::make(std::move(parts))));
  }();
  return text;
}

/// The small model with `change` done to its content, its hash fitting again.
std::string spoiled(const std::function<void(json& content)>& change) {
  json file = json::parse(small_model_text());
  change(file["content"]);
  file["hash"] = sha256_hex(file["content"].dump());
  return file.dump();
}

Refusal refusal_with(const std::string& text) {
  const Result<CompensatedModel> model = deserialize(text, "cell.model");
  return refusal_of(model);
}

std::string repeated(const std::string& part, std::size_t times) {
  std::string text;
  text.reserve(part.size() * times);
  for (std::size_t i = 0; i < times; ++i) text += part;
  return text;
}

/// A file whose content is `content`, with the hash that fits.
std::string file_with(const std::string& content) {
  return R"({"content":)" + content + R"(,"hash":")" + sha256_hex(content) +
         R"(","stamp":{"program_version":"1","trained_at":1},"trammel_model":2})";
}

Refusal too_large(double count, double limit) {
  return Refusal("cell.model").of(ErrorCode::kTooLarge).beyond(count, limit);
}

/// On a stack as small as a thread may have.
Refusal refusal_on_a_small_stack(const std::string& text) {
  struct Task {
    const std::string& text;
    Refusal refusal;
  } task{text, {}};
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, std::size_t{256} << 10);
  pthread_t thread{};
  const auto body = [](void* of) -> void* {
    auto* its = static_cast<Task*>(of);
    its->refusal = refusal_with(its->text);
    return nullptr;
  };
  EXPECT_EQ(pthread_create(&thread, &attributes, body, &task), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
  return task.refusal;
}

TEST(ModelFile, EveryFlippedBitOfASmallFileIsRefused) {
  std::string text = small_model_text();
  ASSERT_EQ(refusal_with(text), Refusal::none());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char good = text[i];
    for (int bit = 0; bit < 8; ++bit) {
      text[i] = static_cast<char>(good ^ (1 << bit));
      ASSERT_FALSE(deserialize(text, "cell.model"))
          << "byte " << i << " bit " << bit << " in "
          << text.substr(i - std::min<std::size_t>(i, 20), 40);
    }
    text[i] = good;
  }
}

TEST(ModelFile, EveryTruncationOfASmallFileIsRefused) {
  const std::string& text = small_model_text();
  for (std::size_t size = 0; size < text.size(); ++size) {
    ASSERT_FALSE(deserialize(text.substr(0, size), "cell.model"))
        << size << " bytes of " << text.size();
  }
}

TEST(ModelFile, NamesItsFormatInItsOwnWords) {
  json file = json::parse(small_model_text());
  file.erase("self_test");
  EXPECT_EQ(refusal_with(file.dump()), Refusal("cell.model", {}, "self_test"));
  for (const char* other : {"1", "3"}) {
    file = json::parse(small_model_text());
    file["trammel_model"] = json::parse(other);
    EXPECT_EQ(refusal_with(file.dump()), Refusal("cell.model", {}, "trammel_model").text(other));
  }
}

/// The small model with `change` done to its self test, its hash fitting again.
Refusal refusal_of_self_test(const std::function<void(json& self_test)>& change) {
  json file = json::parse(small_model_text());
  change(file["self_test"]);
  file["self_test_hash"] = sha256_hex(file["self_test"].dump());
  return refusal_with(file.dump());
}

TEST(ModelFile, ThatWouldPredictOtherwiseNowIsRefused) {
  const json self_test = json::parse(small_model_text())["self_test"];
  ASSERT_EQ(self_test.size(), 4u);
  EXPECT_EQ(refusal_of_self_test([](json&) {}), Refusal::none());
  for (const char* part : {"X_BT", "error_m", "stddev_m"}) {
    for (std::size_t pose = 0; pose < self_test.size(); ++pose) {
      const double value = self_test[pose][part]["values"].back();
      const auto changed_by = [&](double change) {
        const std::string text = spoiled([](json&) {});
        json file = json::parse(text);
        file["self_test"][pose][part]["values"].back() = value + change;
        file["self_test_hash"] = sha256_hex(file["self_test"].dump());
        return deserialize(file.dump(), "cell.model");
      };
      EXPECT_TRUE(changed_by(1e-12)) << "another processor rounds otherwise";
      const bool is_stddev = part == std::string("stddev_m");
      const auto read = changed_by(is_stddev ? 0.1 * value : 1e-6);
      ASSERT_FALSE(read) << part << " of pose " << pose;
      EXPECT_EQ(read.error().field, "self_test");
      if (!is_stddev) continue;
      EXPECT_TRUE(changed_by(0.02 * value)) << "stated too large, as files from before may have it";
      EXPECT_FALSE(changed_by(-0.02 * value)) << "stated too small";
    }
  }
}

TEST(ModelFile, WhosePredictionsAreOfAnotherModelIsRefusedThoughBothHashesFit) {
  const auto moved = [](json& content) {
    content["X_WB"]["values"][3] =
        1.0;  // the nominal base: nothing of it in an error in B, all of it in the model
    content["values"]["values"][0] = 2e-3;
    content["parameters"][0]["value"] = 2e-3;
  };
  const auto read = deserialize(spoiled(moved), "cell.model");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().field, "self_test") << sentence(read.error());
}

TEST(ModelFile, AnySelfTestIsRefusedInASentence) {
  const Refusal wrong("cell.model");
  EXPECT_EQ(refusal_of_self_test([](json& s) { s = nullptr; }), wrong);
  EXPECT_EQ(refusal_of_self_test([](json& s) { s[0]["q"]["values"][0] = "x"; }), wrong);
  EXPECT_EQ(refusal_of_self_test([](json& s) {
              s[0]["q"] = {{"rows", 1}, {"columns", 1}, {"values", {0}}};
            }),
            Refusal("cell.model", {}, "self_test"));
  EXPECT_EQ(refusal_of_self_test([](json& s) { s[0]["tool"] = "saw"; }),
            Refusal("cell.model", {}, "self_test").text("saw"));
  EXPECT_EQ(refusal_of_self_test([](json& s) { s[0]["payload"] = "lead"; }),
            Refusal("cell.model", {}, "self_test").text("spindle"));
  EXPECT_EQ(refusal_of_self_test([](json& s) {
              for (int i = 0; i < 20; ++i) s.push_back(s[0]);
            }),
            Refusal("cell.model", {}, "self_test").of(ErrorCode::kTooLarge).beyond(24, 10));
}

TEST(ModelFile, ThatPredictsNoLengthIsRefused) {
  json file = json::parse(small_model_text());
  file["content"]["values"]["values"][0] = 1e300;
  file["content"]["parameters"][0]["value"] = 1e300;
  file["hash"] = sha256_hex(file["content"].dump());
  EXPECT_EQ(refusal_with(file.dump()), Refusal("cell.model", {}, "self_test"));
}

TEST(ModelFile, NestedAMillionDeepIsRefusedOnTheSmallestStack) {
  const std::size_t million = 1'000'000;
  for (const auto& [open, close] :
       std::vector<std::pair<std::string, std::string>>{{"[", "]"}, {"{\"a\":", "}"}}) {
    const std::string unclosed = R"({"trammel_model":2,"content":)" + repeated(open, million);
    EXPECT_EQ(refusal_on_a_small_stack(unclosed), too_large(17, 16));
    const std::string closed =
        file_with(repeated(open, million) + (open == "[" ? "" : "1") + repeated(close, million));
    EXPECT_EQ(refusal_on_a_small_stack(closed), too_large(17, 16));
  }
}

TEST(ModelFile, WhatIsTooLargeIsRefusedBeforeItIsParsed) {
  EXPECT_EQ(refusal_with(repeated("[", 30'000'000)), too_large(17, 16));
  EXPECT_EQ(refusal_with(file_with("[" + repeated("[],", 10'000'000) + "1]")),
            too_large(200'001, 200'000));
  EXPECT_EQ(refusal_with(file_with("[" + repeated("0,", 20'000'000) + "0]")),
            too_large(4'000'001, 4'000'000));
  EXPECT_EQ(refusal_with(file_with('"' + std::string(100'000'000, 'x') + '"')),
            too_large(100'000'002, 1'048'576));
  EXPECT_EQ(refusal_with(file_with(std::string(100'000'000, '9'))), too_large(100'000'000, 64));
  EXPECT_EQ(refusal_with(std::string(300'000'000, ' ')), too_large(300'000'000, 268'435'456));
}

TEST(ModelFile, AnyTypeInAnyPlaceIsRefusedInASentence) {
  const json good = json::parse(small_model_text())["content"].flatten();
  const std::vector<json> others = {nullptr,
                                    true,
                                    "x",
                                    -1,
                                    1e300,
                                    std::numeric_limits<std::uint64_t>::max(),
                                    json::array(),
                                    json::object(),
                                    json::array({json::array()})};
  for (const auto& [path, value] : good.items()) {  // of an empty list null
    for (const json& other : others) {
      const std::string text =
          spoiled([&](json& content) { content[json::json_pointer(path)] = other; });
      const Result<CompensatedModel> read =
          deserialize(text, "cell.model");  // refused, or a value that can be
      if (!read) {
        EXPECT_TRUE(read.error().file.starts_with("cell.model"))
            << path << ": " << sentence(read.error());
        EXPECT_FALSE(read.error().message.empty()) << path;
      }
      EXPECT_TRUE(!read || other.is_primitive() || value.is_null()) << path << " = " << other;
    }
    const std::string without = spoiled([&](json& content) {
      const json::json_pointer at(path);
      if (content[at.parent_pointer()].is_object())
        content[at.parent_pointer()].erase(at.back());
      else
        content[at.parent_pointer()].clear();
    });
    static_cast<void>(deserialize(without, "cell.model"));  // ends
  }
}

TEST(ModelFile, WhatCannotBeAModelIsRefusedThoughItsHashFits) {
  const auto frame = [](std::vector<double> values) {
    return json{{"rows", 3}, {"columns", 4}, {"values", std::move(values)}};
  };
  const auto refused_with = [](const std::function<void(json&)>& change) {
    return refusal_with(spoiled(change));
  };
  EXPECT_EQ(refused_with([&](json& c) {
              c["X_WB"] = frame({2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
            }),
            Refusal("cell.model", {}, "base").beyond(3, 1e-06));
  EXPECT_EQ(refused_with([&](json& c) {
              c["tools"]["spindle"] = frame({-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
            }),
            Refusal("cell.model", {}, "tool spindle").beyond(-1, 0));
  EXPECT_EQ(refused_with([&](json& c) {
              c["X_WB"] = frame({1, 0, 0, 1e9, 0, 1, 0, 0, 0, 0, 1, 0});
            }),
            Refusal("cell.model", {}, "base"));
  EXPECT_EQ(refused_with([](json& c) { c["values"]["values"][0] = nullptr; }),
            Refusal("cell.model"));
  EXPECT_EQ(refused_with([](json& c) { c["covariance"]["values"][1] = 1e-9; }),
            Refusal("cell.model", {}, "covariance").beyond(0.1, 1e-06));
  EXPECT_EQ(refused_with([](json& c) { c["covariance"]["values"][0] = -1e-9; }),
            Refusal("cell.model", {}, "covariance").beyond(-1e-09, 0));
  EXPECT_EQ(refused_with([](json& c) {
              c["covariance"]["values"][0] = 0;
              c["covariance"]["values"][1] = 1e-9;
            }),
            Refusal("cell.model", {}, "covariance"));
  EXPECT_EQ(refused_with([](json& c) {
              const std::size_t P = c["covariance"]["rows"];
              c["covariance"]["values"][1] = c["covariance"]["values"][P] = 1.5e-8;
            }),
            Refusal("cell.model", {}, "covariance"));
  EXPECT_EQ(refused_with([](json& c) {
              c["covariance"] = {{"rows", 1}, {"columns", 1}, {"values", {1.0}}};
            }),
            Refusal("cell.model", {}, "covariance").beyond(1, 6));
  EXPECT_EQ(refused_with([](json& c) { c["parameters"].erase(0); }),
            Refusal("cell.model", {}, "parameters").beyond(5, 6));
  EXPECT_EQ(refused_with([](json& c) { c["parameters"][0]["stddev"] = -1; }),
            Refusal("cell.model", {}, "x0").beyond(-1, 0));
  EXPECT_EQ(refused_with([](json& c) { c["rank"] = 99; }),
            Refusal("cell.model", {}, "rank").beyond(99, 6));
  EXPECT_EQ(refused_with([](json& c) { c["q_min"]["values"][0] = 9; }),
            Refusal("cell.model", {}, "joint_ranges"));
  EXPECT_EQ(refused_with([](json& c) {
              c["trained_with"] = json::array({json::array({"drill", ""})});
            }),
            Refusal("cell.model", {}, "trained_with").text("drill"));
  EXPECT_EQ(
      refused_with([](json& c) { c["error_sources"] = std::vector<std::string>(100'000, "base"); }),
      Refusal("cell.model", {}, "error_sources").beyond(100000, 500));
  EXPECT_EQ(refused_with([](json& c) {
              c["error_sources"] = {"gear_transmission:3@" + repeated("5+", 9999)};
            }),
            Refusal("cell.model", {}, "error_sources").beyond(20018, 1000));
  EXPECT_EQ(refused_with([](json& c) {
              c["error_sources"] = json::array();
              for (int joint = 1; joint <= 6; ++joint)
                c["error_sources"].push_back(fmt::format("joint_map:{}@500", joint));
            }),
            Refusal("cell.model", {}, "error_sources").beyond(2000, 1300).text("joint_map:2@500"));
  EXPECT_EQ(refused_with([](json& c) { c["cell_yaml"] = "[[["; }), Refusal("cell.model"));
  EXPECT_EQ(refused_with([](json& c) { c["robot_yaml"] = repeated("[", 100'000); }),
            Refusal("cell.model (robot)").of(ErrorCode::kTooLarge).beyond(21, 20));
}

TEST(ModelFile, TextsAndTimesThatNobodyCanBeToldAreRefusedInAFileAndLeftInWhatWasAcceptedBefore) {
  const auto with = [](const char* part, const std::function<void(json&)>& change) {
    json file = json::parse(small_model_text());
    change(file[part]);
    file[fmt::format("{}hash", part == std::string("stamp") ? "stamp_" : "")] =
        sha256_hex(file[part].dump());
    return file.dump();
  };
  const auto provenance = [&](const char* key, const std::string& text) {
    return with("content", [&](json& content) { content["provenance"][key] = text; });
  };
  const auto stamp = [&](const char* key, const json& value) {
    return with("stamp", [&](json& its) { its[key] = value; });
  };
  const std::string escape = "\x1b[31m";
  const std::vector<std::string> wrong = {
      provenance("level", std::string(4097, 'x')),
      provenance("level", escape),
      provenance("batch_id", "a+" + std::string(257, 'b')),
      provenance("batch_id", repeated("a+", 1000)),
      provenance("batch_id", "a\nb"),
      provenance("batch_hash", std::string(257, 'h')),
      provenance("batch_hash", "a\xe2\x80\x8b"),
      with("content",
           [&](json& c) {
             c["suspects"] = {{{"pose_id", escape}, {"row", 1}, {"distance_m", 0}, {"sigmas", 1}}};
           }),
      with("content",
           [&](json& c) {
             c["unidentifiable"] = {
                 {{"singular_value", 0}, {"parameters", {"a"}}, {"sentence", "see\x1b[2J"}}};
           }),
      stamp("program_version", escape),
      stamp("program_version", std::string(257, '1')),
      stamp("trained_at", std::int64_t{1} << 62),
      stamp("trained_at", std::numeric_limits<std::int64_t>::min()),
      stamp("measured_at", -1),
      stamp("measured_at", 253'402'300'800)};
  for (const std::string& text : wrong) {
    EXPECT_FALSE(deserialize(text, "cell.model")) << text.substr(0, 300);
    EXPECT_TRUE(deserialize(text, "cell.model", ModelTexts::kAsTheyAre)) << text.substr(0, 300);
  }
  EXPECT_EQ(refusal_with(wrong.front()),
            Refusal("cell.model", {}, "level").of(ErrorCode::kTooLarge).beyond(4097, 4096));
  EXPECT_EQ(refusal_with(provenance("batch_id", repeated("a+", 999) + std::string(256, 'b'))),
            Refusal::none());
}

TEST(ModelFile, ABiasThatNobodyCouldServeIsRefused) {
  const auto bias_of = [](const std::string& kernel, std::size_t poses) {
    const auto matrix = [](std::size_t rows, std::size_t columns, double value) {
      return json{{"rows", rows},
                  {"columns", columns},
                  {"values", std::vector<double>(rows * columns, value)}};
    };
    return json{{"kernel", kernel},
                {"q", matrix(poses, 6, 0.5)},
                {"residual_B", matrix(poses, 3, 1e-4)},
                {"sigma", matrix(poses, 1, 1e-5)},
                {"offset", matrix(3, 1, 0)},
                {"hyperparameters", matrix(3, 3, -9)}};
  };
  const auto refused_bias = [&](const std::string& kernel, std::size_t poses) {
    return refusal_with(spoiled([&](json& c) { c["bias"] = bias_of(kernel, poses); }));
  };
  EXPECT_EQ(refused_bias("se", 100'000),
            Refusal("cell.model", {}, "bias").of(ErrorCode::kTooLarge).beyond(100000, 20000));
  EXPECT_EQ(refused_bias("se" + repeated(" + se", 50), 20),
            Refusal("cell.model", {}, "bias")
                .of(ErrorCode::kTooLarge)
                .beyond(51, 32)
                .text("se" + repeated(" + se", 50)));
  EXPECT_EQ(refused_bias(repeated("(", 2'000), 20),
            Refusal("cell.model", {}, "bias").of(ErrorCode::kTooLarge).beyond(2000, 1000));
  EXPECT_EQ(refused_bias(repeated("(", 100'000), 20),
            Refusal("cell.model", {}, "kernel").of(ErrorCode::kTooLarge).beyond(100000, 4096));
  EXPECT_EQ(refusal_with(spoiled([&](json& c) {
              c["bias"] = bias_of("se", 20);
              c["bias"]["hyperparameters"]["values"][0] = 1e300;
            })),
            Refusal("cell.model", {}, "bias"));
}

/// A model of `source` on an arm whose joint 3 follows joint 2, with `change` done to its content.
std::string coupled(const std::string& source, const std::function<void(json& content)>& change) {
  std::string robot = test::small_robot_yaml();
  const std::string none = "coupling: []";
  robot.replace(robot.find(none), none.size(), "coupling: [{joint: 3, follows: 2, ratio: -1}]");
  const auto cell = std::make_shared<const Cell>(
      test::demand(parse_cell(test::small_cell_yaml("cell-1"), robot, "cell.yaml")));
  CompensatedModel::Parts parts = test::nominal_model(cell, 40).parts();
  parts.physics = test::demand(make_physical_model(cell, {source}));
  const auto P = parts.physics.values.size();
  parts.covariance = Eigen::MatrixXd::Identity(P, P) * 1e-8;
  for (const Parameter& p : parts.physics.parameters())
    parts.parameters.push_back({p, p.prior, 1e-4, true});
  parts.rank = static_cast<int>(P);
  parts.provenance.trained_at = 1'700'000'000;
  json file = json::parse(serialize(test::demand(CompensatedModel::make(std::move(parts)))));
  change(file["content"]);
  file["hash"] = sha256_hex(file["content"].dump());
  return file.dump();
}

TEST(ModelFile, WhoseCausesOfACoupledJointFollowedTheCommandedAngleIsToBeTrainedAgain) {
  const auto as_before = [](json& content) { content.erase("angles"); };
  for (const char* source : {"gear_transmission:3@48.5", "backlash:2", "joint_map:3@2",
                             "encoder_eccentricity:3", "joint_slip:2@5", "early_reading"}) {
    EXPECT_EQ(refusal_with(coupled(source, as_before)),
              Refusal("cell.model", {}, "angles").text(source));
    EXPECT_EQ(refusal_with(coupled(source, [](json&) {})), Refusal::none()) << source;
  }
  for (const char* source : {"base", "geometry", "tool", "backlash:5"})
    EXPECT_EQ(refusal_with(coupled(source, as_before)), Refusal::none()) << source;
}

TEST(ModelFile, ADeviceThatNeverEndsIsNoModel) {
  const Result<CompensatedModel> endless = load_model("/dev/zero");
  ASSERT_FALSE(endless);
  EXPECT_EQ(refusal_of(endless),
            Refusal("/dev/zero").of(ErrorCode::kTooLarge).beyond((1 << 28) + (1 << 16), 1 << 28));
}

}  // namespace
}  // namespace trammel
