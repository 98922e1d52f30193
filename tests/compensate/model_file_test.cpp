#include "server/compensate/model_file.h"

#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using nlohmann::json;

/// A model of a base, as a file has it.
const std::string& small_model_text() {
  static const std::string text = [] {
    const auto cell = test::small_cell("cell-1");
    CompensatedModel::Parts parts = test::nominal_model(cell, 40).parts();
    parts.physics = test::demand(make_physical_model(cell, {"base"}));
    const auto P = parts.physics.values.size();
    parts.covariance = Eigen::MatrixXd::Identity(P, P) * 1e-8;
    for (const Parameter& p : parts.physics.parameters()) parts.parameters.push_back({p, 0.0, 1e-4, true});
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

std::string message_of(const std::string& text) {
  const Result<CompensatedModel> model = deserialize(text, "cell.model");
  return model ? "accepted" : model.error().message;
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
         R"(","stamp":{"program_version":"1","trained_at":1},"trammel_model":1})";
}

/// On a stack as small as a thread may have.
std::string message_on_a_small_stack(const std::string& text) {
  struct Task {
    const std::string& text;
    std::string message;
  } task{text, {}};
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, std::size_t{256} << 10);
  pthread_t thread{};
  const auto body = [](void* of) -> void* {
    auto* its = static_cast<Task*>(of);
    its->message = message_of(its->text);
    return nullptr;
  };
  EXPECT_EQ(pthread_create(&thread, &attributes, body, &task), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
  return task.message;
}

TEST(ModelFile, EveryFlippedBitOfASmallFileIsRefused) {
  std::string text = small_model_text();
  ASSERT_EQ(message_of(text), "accepted");
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char good = text[i];
    for (int bit = 0; bit < 8; ++bit) {
      text[i] = static_cast<char>(good ^ (1 << bit));
      ASSERT_FALSE(deserialize(text, "cell.model"))
          << "byte " << i << " bit " << bit << " in " << text.substr(i - std::min<std::size_t>(i, 20), 40);
    }
    text[i] = good;
  }
}

TEST(ModelFile, EveryTruncationOfASmallFileIsRefused) {
  const std::string& text = small_model_text();
  for (std::size_t size = 0; size < text.size(); ++size) {
    ASSERT_FALSE(deserialize(text.substr(0, size), "cell.model")) << size << " bytes of " << text.size();
  }
}

TEST(ModelFile, OfBeforeTheStampWasHashedIsStillRead) {
  json file = json::parse(small_model_text());
  file.erase("stamp_hash");
  const Result<CompensatedModel> model = deserialize(file.dump() + "\n", "cell.model");
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_EQ(serialize(*model), small_model_text());
}

TEST(ModelFile, NestedAMillionDeepIsRefusedOnTheSmallestStack) {
  const std::size_t million = 1'000'000;
  for (const auto& [open, close] : std::vector<std::pair<std::string, std::string>>{{"[", "]"}, {"{\"a\":", "}"}}) {
    const std::string unclosed = R"({"trammel_model":1,"content":)" + repeated(open, million);
    EXPECT_NE(message_on_a_small_stack(unclosed).find("inside one another, limit"), std::string::npos);
    const std::string closed = file_with(repeated(open, million) + (open == "[" ? "" : "1") + repeated(close, million));
    EXPECT_NE(message_on_a_small_stack(closed).find("inside one another, limit"), std::string::npos);
  }
}

TEST(ModelFile, WhatIsTooLargeIsRefusedBeforeItIsParsed) {
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {repeated("[", 30'000'000), "inside one another"},
      {file_with("[" + repeated("[],", 10'000'000) + "1]"), "arrays and objects, limit"},
      {file_with("[" + repeated("0,", 20'000'000) + "0]"), "values, limit"},
      {file_with('"' + std::string(100'000'000, 'x') + '"'), "bytes in one text, limit"},
      {file_with(std::string(100'000'000, '9')), "bytes in one number, limit"},
      {std::string(300'000'000, ' '), "300000000 bytes, limit"}};
  for (const auto& [text, part] : wrong) {
    EXPECT_NE(message_of(text).find(part), std::string::npos) << message_of(text);
  }
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
      const std::string text = spoiled([&](json& content) { content[json::json_pointer(path)] = other; });
      const std::string message = message_of(text);  // ends: refused, or a value that can be
      if (message != "accepted") {
        EXPECT_EQ(message.rfind("cell.model", 0), 0u) << path << ": " << message;
      }
      EXPECT_TRUE(message != "accepted" || other.is_primitive() || value.is_null()) << path << " = " << other;
    }
    EXPECT_NE(message_of(spoiled([&](json& content) {
                const json::json_pointer at(path);
                if (content[at.parent_pointer()].is_object())
                  content[at.parent_pointer()].erase(at.back());
                else
                  content[at.parent_pointer()].clear();
              })),
              "");
  }
}

TEST(ModelFile, WhatCannotBeAModelIsRefusedThoughItsHashFits) {
  const auto frame = [](std::vector<double> values) {
    return json{{"rows", 3}, {"columns", 4}, {"values", std::move(values)}};
  };
  const auto refused_with = [](const std::string& part, const std::function<void(json&)>& change) {
    const std::string message = message_of(spoiled(change));
    EXPECT_NE(message.find(part), std::string::npos) << message;
  };
  refused_with("base: its rotation is not rigid", [&](json& c) {
    c["X_WB"] = frame({2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
  });
  refused_with("tool spindle: its rotation is not rigid", [&](json& c) {
    c["tools"]["spindle"] = frame({-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
  });
  refused_with("its place is no length", [&](json& c) { c["X_WB"] = frame({1, 0, 0, 1e9, 0, 1, 0, 0, 0, 0, 1, 0}); });
  refused_with("expected a finite number", [](json& c) { c["values"]["values"][0] = nullptr; });
  refused_with("not symmetric", [](json& c) { c["covariance"]["values"][1] = 1e-9; });
  refused_with("has the variance", [](json& c) { c["covariance"]["values"][0] = -1e-9; });
  refused_with("no variance but a covariance", [](json& c) {
    c["covariance"]["values"][0] = 0;
    c["covariance"]["values"][1] = 1e-9;
  });
  refused_with("not positive semidefinite", [](json& c) {
    const std::size_t P = c["covariance"]["rows"];
    c["covariance"]["values"][1] = c["covariance"]["values"][P] = 1.5e-8;
  });
  refused_with("a covariance of 1 x 1", [](json& c) {
    c["covariance"] = {{"rows", 1}, {"columns", 1}, {"values", {1.0}}};
  });
  refused_with("parameters, expected", [](json& c) { c["parameters"].erase(0); });
  refused_with("has the stddev", [](json& c) { c["parameters"][0]["stddev"] = -1; });
  refused_with("rank 99", [](json& c) { c["rank"] = 99; });
  refused_with("a joint range ends before it begins", [](json& c) { c["q_min"]["values"][0] = 9; });
  refused_with("which its cell does not have", [](json& c) {
    c["trained_with"] = json::array({json::array({"drill", ""})});
  });
  refused_with("error sources, limit 500",
               [](json& c) { c["error_sources"] = std::vector<std::string>(100'000, "base"); });
  refused_with("bytes, limit 1000",
               [](json& c) { c["error_sources"] = {"gear_transmission:3@" + repeated("5+", 9999)}; });
  refused_with("parameters with those before it, limit 4000", [](json& c) {
    c["error_sources"] = json::array();
    for (int joint = 1; joint <= 6; ++joint) c["error_sources"].push_back(fmt::format("joint_map:{}@500", joint));
  });
  refused_with("not YAML", [](json& c) { c["cell_yaml"] = "[[["; });
  refused_with("inside one another, limit 20", [](json& c) { c["robot_yaml"] = repeated("[", 100'000); });
}

TEST(ModelFile, ABiasThatNobodyCouldServeIsRefused) {
  const auto bias_of = [](const std::string& kernel, std::size_t poses) {
    const auto matrix = [](std::size_t rows, std::size_t columns, double value) {
      return json{{"rows", rows}, {"columns", columns}, {"values", std::vector<double>(rows * columns, value)}};
    };
    return json{{"kernel", kernel},
                {"q", matrix(poses, 6, 0.5)},
                {"residual_B", matrix(poses, 3, 1e-4)},
                {"sigma", matrix(poses, 1, 1e-5)},
                {"offset", matrix(3, 1, 0)},
                {"hyperparameters", matrix(3, 3, -9)}};
  };
  const auto message = [&](const std::string& kernel, std::size_t poses) {
    return message_of(spoiled([&](json& c) { c["bias"] = bias_of(kernel, poses); }));
  };
  EXPECT_NE(message("se", 100'000).find("its bias has 100000 poses, limit 20000"), std::string::npos);
  EXPECT_NE(message("se" + repeated(" + se", 50), 20).find("51 kernels, limit 32"), std::string::npos);
  EXPECT_NE(message(repeated("(", 100'000), 20).find("100000 bytes, limit 1000"), std::string::npos);
  EXPECT_NE(message_of(spoiled([&](json& c) {
              c["bias"] = bias_of("se", 20);
              c["bias"]["hyperparameters"]["values"][0] = 1e300;
            })).find("beyond 200"),
            std::string::npos);
}

TEST(ModelFile, ADeviceThatNeverEndsIsNoModel) {
  const Result<CompensatedModel> endless = load_model("/dev/zero");
  ASSERT_FALSE(endless);
  EXPECT_NE(endless.error().message.find("/dev/zero: more than"), std::string::npos) << endless.error().message;
}

}  // namespace
}  // namespace trammel
