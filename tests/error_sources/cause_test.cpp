#include "server/error_sources/cause.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <thread>

#include "server/base/text_file.h"
#include "server/error_sources/catalogue.h"
#include "server/error_sources/cause_words.h"
#include "server/error_sources/spelling.h"

namespace trammel {
namespace {

using causes::Scope;

Cell cell_7() { return *read_cell(std::string(TRAMMEL_SOURCE_DIR) + "/config/cell-7.yaml"); }

Cell cell_on_a_rail() {
  Cell cell = cell_7();
  cell.robot =
      *read_robot(std::string(TRAMMEL_SOURCE_DIR) + "/models/abb_irb6640-205-275-on-rail.yaml");
  cell.joint_ranges.clear();
  return cell;
}

/// The source that a list spells by this form, of a joint and from a pose on where it takes them,
/// with a number where it wants one; of joint 2 of cell-7, or of the rail.
Result<ErrorSourcePtr> some_source(const CauseRecord& record, std::string_view form) {
  const bool of_joint = record.scope == Scope::kJoint;
  const std::string at = record.lasting == causes::Lasting::kFromAPose ? "@3" : "";
  Result<ErrorSourcePtr> source =
      make_error_source(fmt::format("{}{}{}", form, of_joint ? ":2" : "", at), cell_7());
  if (!source && of_joint) source = make_error_source(fmt::format("{}:2@40", form), cell_7());
  if (!source && of_joint) source = make_error_source(fmt::format("{}:1", form), cell_on_a_rail());
  if (!source && of_joint)
    source = make_error_source(fmt::format("{}:1@40", form), cell_on_a_rail());
  return source;
}

TEST(Causes, EveryRecordSaysEverything) {
  for (const CauseRecord* record : all_causes())
    EXPECT_EQ(fmt::format("{}", fmt::join(missing_in(*record), "; ")), "") << record->spelling;
}

TEST(Causes, ARecordThatLeavesSomethingOutIsTold) {
  const CauseRecord& complete = cause_spelled("joint_slip");
  const auto misses = [&](auto forget) {
    CauseRecord record = complete;
    forget(record);
    return !missing_in(record).empty();
  };
  EXPECT_FALSE(misses([](CauseRecord&) {}));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.spelling = ""; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.plain_name = ""; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.plain_name_of_joint = ""; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.action = ""; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.shown_by = ""; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.told_apart_by = {}; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.figures.clear(); }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.figures.front().meaning = ""; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.rivals.clear(); }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.rivals.front().cause = "gremlins"; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.forms.clear(); }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.acts = {}; }));
  EXPECT_TRUE(misses([](CauseRecord& record) { record.whole_batch.reset(); }));
  EXPECT_TRUE(misses([](CauseRecord& record) {
    record.added_by_data = causes::AddedByData{"gremlins", nullptr, ""};
  }));
}

TEST(Causes, RulesAboutOneCauseAreMembersOfItsRecord) {
  const Cell cell = cell_7();
  for (const causes::StandsFor what :
       {causes::StandsFor::kNoKnownCause, causes::StandsFor::kArmNotAsModelled})
    EXPECT_TRUE(cause_that_stands_for(what).forms.empty()) << "no physics describes it";
  for (const causes::Part part :
       {causes::Part::kBase, causes::Part::kTool, causes::Part::kPayload}) {
    const CauseRecord& record = cause_correcting(part);
    EXPECT_EQ(record.lasting, causes::Lasting::kAlways) << record.spelling;
    EXPECT_TRUE(corrects({std::string(record.spelling)}, part));
  }
  int added = 0;
  for (const CauseRecord* record : all_causes()) {
    if (!record->added_by_data) continue;
    ++added;
    EXPECT_FALSE(cause_spelled(record->added_by_data->beside).forms.empty()) << record->spelling;
    EXPECT_FALSE(record->added_by_data->is_known(cell)) << record->spelling;
    Cell told = cell;
    told.model.error_sources.emplace_back(record->spelling);
    EXPECT_EQ(record->added_by_data->is_known(told), record->needs.temperature)
        << "link masses are told in the robot file";
  }
  EXPECT_EQ(added, 2);
}

TEST(Causes, SpellingsAndNamesForPeopleAreTheirOwn) {
  std::set<std::string_view> spellings, names;
  for (const CauseRecord* record : all_causes()) {
    EXPECT_TRUE(spellings.insert(record->spelling).second) << record->spelling;
    EXPECT_TRUE(names.insert(record->plain_name).second) << record->plain_name;
    EXPECT_EQ(record->plain_name.find('_'), std::string_view::npos) << record->plain_name;
  }
}

TEST(Causes, TheReadmeHasEveryCauseWithBothItsNames) {
  const Result<std::string> readme =
      read_text_file(std::string(TRAMMEL_SOURCE_DIR) + "/server/error_sources/README.md");
  ASSERT_TRUE(readme);
  for (const CauseRecord* record : all_causes()) {
    EXPECT_NE(readme->find(fmt::format("`{}", record->spelling)), std::string::npos)
        << record->spelling;
    EXPECT_NE(readme->find(record->plain_name), std::string::npos) << record->plain_name;
  }
}

TEST(Causes, AnErrorSourceIsOfTheCauseItIsSpelledBy) {
  for (const CauseRecord* record : all_causes()) {
    for (const causes::Form& form : record->forms) {
      const auto source = some_source(*record, form.spelling);
      ASSERT_TRUE(source) << form.spelling;
      EXPECT_EQ(&(*source)->cause(), record) << form.spelling;
      EXPECT_EQ((*source)->joint() >= 0, record->scope == Scope::kJoint) << form.spelling;
    }
  }
}

TEST(Causes, EveryParameterIsAmongTheFiguresOfItsCauseInOrderAndUnit) {
  for (const CauseRecord* record : all_causes()) {
    if (record->forms.empty() || record->summary == causes::Summary::kPeakToPeak) continue;
    const auto source = some_source(*record, record->forms.front().spelling);
    ASSERT_TRUE(source) << record->spelling;
    for (const Parameter& parameter : (*source)->parameters()) {
      const auto fits = [&](const causes::Figure& figure) {
        const std::string_view rest =
            std::string_view(parameter.name)
                .substr(std::min(figure.name.size(), parameter.name.size()));
        return parameter.name.starts_with(figure.name) && parameter.unit == figure.unit &&
               rest.find_first_of("abcdefghijklmnopqrstuvwxyz") == std::string_view::npos;
      };
      EXPECT_TRUE(std::any_of(record->figures.begin(), record->figures.end(), fits))
          << record->spelling << ": " << parameter.name << " in " << parameter.unit;
    }
  }
}

TEST(Causes, PeopleReadPlainNamesAndFilesKeepTheSpelling) {
  EXPECT_EQ(in_words("gear_transmission:3@48.5"), "gear ripple in joint 3");
  EXPECT_EQ(in_words("backlash:2"), "backlash in joint 2");
  EXPECT_EQ(in_words("tracker_moved@40"), "the tracker moved from row 40 on");
  EXPECT_EQ(in_words("geometry:d6"), "link geometry (d6)");
  EXPECT_EQ(in_words("compliance_linear"), "gearbox compliance");
  EXPECT_EQ(in_words("nominal"), "nominal");
  EXPECT_EQ(causes_in_words({}), "");
  EXPECT_EQ(causes_in_words({"geometry", "gear_transmission:3@48.5+97", "tracker_moved@40"}),
            "link geometry, gear ripple in joint 3, the tracker moved from row 40 on");
  EXPECT_EQ(level_in_words("base,geometry,backlash:2"),
            "base position, link geometry, backlash in joint 2");
  EXPECT_EQ(level_in_words(""), "none");
}

TEST(Causes, FormsOfOneCauseAreToldFromOtherCauses) {
  EXPECT_TRUE(are_forms_of_one("compliance_linear", "compliance"));
  EXPECT_TRUE(are_forms_of_one("compliance", "compliance_first_order"));
  EXPECT_TRUE(are_forms_of_one("backlash:2", "backlash:2"));
  EXPECT_FALSE(are_forms_of_one("backlash:2", "backlash:3"));
  EXPECT_FALSE(are_forms_of_one("tool", "tool_changed@3"));
  EXPECT_FALSE(are_forms_of_one("gremlins", "goblins"));
}

TEST(Causes, AddedOnesAreKnownForAsLongAsTheyLive) {
  CauseRecord own = cause_spelled("time_lag");
  own.spelling = "own_lag";
  own.forms.front().spelling = "own_lag";
  const std::size_t before = all_causes().size();
  {
    const AddedCause added(own);
    EXPECT_EQ(find_cause("own_lag@3"), &own);
    EXPECT_EQ(all_causes().back(), &own);
  }
  EXPECT_EQ(find_cause("own_lag"), nullptr);
  EXPECT_EQ(all_causes().size(), before);
}

TEST(Causes, MayBeAddedWhileOthersRead) {
  std::vector<CauseRecord> own(4, cause_spelled("time_lag"));
  const std::string_view spellings[] = {"lag_a", "lag_b", "lag_c", "lag_d"};
  {
    std::vector<std::jthread> threads;
    for (std::size_t k = 0; k < own.size(); ++k) {
      own[k].spelling = own[k].forms.front().spelling = spellings[k];
      threads.emplace_back([&record = own[k]] {
        for (int times = 0; times < 200; ++times) {
          const AddedCause added(record);
          EXPECT_EQ(&cause_spelled(record.spelling), &record);
        }
      });
    }
  }
  for (const std::string_view spelling : spellings) EXPECT_EQ(find_cause(spelling), nullptr);
}

}  // namespace
}  // namespace trammel
