#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <set>

#include "clients/cam/mark.h"
#include "server/base/text_file.h"
#include "server/measurement/files/csv_table.h"
#include "tests/support/shifting_model.h"

// Programs in the manner of posts: tests/clients/programs/KIND/NUMBER-NAME/. What each becomes
// stands in expected.csv.
namespace trammel::cam {
namespace {

namespace fs = std::filesystem;

const std::string kFolder = TRAMMEL_SOURCE_DIR "/tests/clients/programs";

struct Post {
  std::string kind, name;
  std::vector<SourceFile> files;
};

std::vector<Post> posts_of(const std::string& kind) {
  std::vector<Post> posts;
  std::set<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(kFolder + "/" + kind))
    folders.insert(entry.path());
  for (const fs::path& folder : folders) {
    Post post{kind, folder.filename().string(), {}};
    std::set<fs::path> files{fs::directory_iterator(folder), fs::directory_iterator()};
    for (const fs::path& file : files)
      post.files.push_back({file.filename().string(), read_text_file(file.string()).value()});
    posts.push_back(std::move(post));
  }
  return posts;
}

ReadOptions reading() {
  const Pose X_FT = test::spindle_only().tools.at("spindle");
  const Pose panel = make_pose(Matrix3::Identity(), {1.8, -.25, .8});
  return {.frames = {{"UTOOL[1]", X_FT},
                     {"TOOL[1]", X_FT},
                     {"UFRAME[1]", panel},
                     {"UFRAME[2]", make_pose(rotation_exp({0, 0, .05}), {1.795, -.24, .81})},
                     {"USER[1]", panel}}};
}

Dialect dialect_of(const Post& post) { return *dialect_called(post.kind); }

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size() - 1) + 1;
    lines.push_back(text.substr(at, end - at));
    at = end;
  }
  return lines;
}

/// Every byte that is no number stands where it was, and what was folded stands in lines that the
/// receipt names.
void expect_bytes_kept(const Post& post, const test::Corrected& made) {
  for (std::size_t f = 0; f < post.files.size(); ++f) {
    const std::vector<std::string> before = lines_of(post.files[f].text);
    const std::vector<std::string> after = lines_of(test::without_inserted(made.program, f));
    ASSERT_EQ(before.size(), after.size()) << post.files[f].name;
    std::set<int> folded;
    for (const ReceiptRow& row : made.program.rows) {
      if (row.folded && row.file == post.files[f].name)
        folded.insert(row.used_at.begin(), row.used_at.end());
    }
    for (std::size_t i = 0; i < before.size(); ++i) {
      if (folded.contains(static_cast<int>(i) + 1)) continue;
      EXPECT_EQ(test::without_numbers(before[i]), test::without_numbers(after[i]))
          << post.files[f].name << " line " << i + 1;
    }
  }
}

/// Read anew, the program goes where its targets were and the shift beyond.
void expect_shifted(const Post& post, const test::Corrected& made) {
  const Program again = read_program(dialect_of(post), made.program.files, reading());
  for (const ReceiptRow& row : made.program.rows) {
    if (!row.corrected() || is_joints(row.coordinates)) continue;
    const Vector3 wanted = row.p_B + test::kShift_mm * from_mm(1);
    double nearest = 1;
    for (const ProgramTarget& target : again.targets) {
      if (is_joints(target.coordinates)) continue;
      const Vector3 p = again.frames[target.frame].X_BO *
                        pose_of(target.coordinates, target.numbers).translation();
      nearest = std::min(nearest, (p - wanted).norm());
    }
    EXPECT_LT(to_mm(nearest), 2e-3) << row.name << " of " << row.file << " line " << row.line;
  }
}

class Posts : public testing::TestWithParam<std::string> {};

TEST_P(Posts, ComeBackWithCorrectedNumbersAndEveryOtherByte) {
  const CsvTable expected =
      CsvTable::parse(read_text_file(kFolder + "/expected.csv").value(), "expected.csv").value();
  std::map<std::string, std::string> wanted;
  for (std::size_t row = 0; row < expected.size(); ++row)
    wanted[expected.field(row, 0)] =
        expected.field(row, 1) + " " + expected.field(row, 2) + " " + expected.field(row, 3);
  for (const Post& post : posts_of(GetParam())) {
    SCOPED_TRACE(post.kind + "/" + post.name);
    const test::Corrected made = test::corrected_by_shift(dialect_of(post), post.files, reading());
    ASSERT_EQ(made.refusal, "");
    expect_bytes_kept(post, made);
    expect_shifted(post, made);
    EXPECT_EQ(fmt::format("{} {} {}", made.program.moves, made.program.moves_corrected,
                          made.program.left_alone()),
              wanted[post.kind + "/" + post.name]);
    for (const ReceiptRow& row : made.program.rows)
      EXPECT_TRUE(row.corrected() || !row.message.empty()) << row.name;
    for (const std::string& note : made.program.notes)
      EXPECT_EQ(note.find("look taught"), std::string::npos) << note;
    for (const SourceFile& file : post.files) {
      const auto at = static_cast<std::size_t>(&file - post.files.data());
      if (!made.program.changed[at]) continue;
      EXPECT_EQ(find_mark(made.program.files[at].text)->original, short_hash(file.text));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, Posts,
                         testing::Values("rapid", "krl", "fanuc", "inform", "urscript", "camrob",
                                         "robodk"),
                         [](const auto& kind) { return kind.param; });

TEST(Posts, AreEnoughOfEachKind) {
  for (const char* kind : {"rapid", "krl", "fanuc"}) EXPECT_GE(posts_of(kind).size(), 15u) << kind;
  for (const char* kind : {"inform", "urscript", "camrob", "robodk"})
    EXPECT_GE(posts_of(kind).size(), 6u) << kind;
}

}  // namespace
}  // namespace trammel::cam
