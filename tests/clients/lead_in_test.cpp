#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "clients/cam/nominal_targets.h"
#include "clients/cli/service/answers.h"
#include "server/measurement/pose_columns.h"
#include "tests/support/shifting_model.h"

namespace trammel::cam {
namespace {

struct Sample {
  Dialect dialect;
  std::string text;
};

/// A hole in front of the arm, come to by a motion that stops, and one that is passed.
std::vector<Sample> samples() {
  return {
      {Dialect::kRapid,
       "MODULE M\r\n  PERS tooldata "
       "tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,"
       "0]];\r\nPROC main()\r\n"
       "  MoveL [[1800,-300,1200],[0.707107,0,0.707107,0],[-1,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
       "v100,z10,tSpindle;\r\n"
       "  MoveL [[1800,-250,1200],[0.707107,0,0.707107,0],[-1,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
       "v100,fine,tSpindle; ! hole\r\nENDPROC\r\nENDMODULE\r\n"},
      {Dialect::kKrl,
       "DEF d( )\n$TOOL={X 100.0,Y 0.0,Z 150.0,A 0.0,B -45.0,C 0.0}\n$BASE=$NULLFRAME\n"
       "PTP {X 1800.0,Y -300.0,Z 1200.0,A 0.0,B 90.0,C 0.0} C_PTP\n"
       "LIN {X 1800.0,Y -250.0,Z 1200.0,A 0.0,B 90.0,C 0.0}\nEND\n"},
      {Dialect::kFanuc,
       "/PROG  D\n/MN\n   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n   3:J P[1] 100% CNT50    ;\n"
       "   4:L P[2:\"hole\"] 250mm/sec FINE    ;\n/POS\n"
       "P[1]{\n   GP1:\n\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
       "\tX =  1800.000  mm,\tY =  -300.000  mm,\tZ =  1200.000  mm,\n"
       "\tW =      .000 deg,\tP =    90.000 deg,\tR =      .000 deg\n};\n"
       "P[2:\"hole\"]{\n   GP1:\n\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
       "\tX =  1800.000  mm,\tY =  -250.000  mm,\tZ =  1200.000  mm,\n"
       "\tW =      .000 deg,\tP =    90.000 deg,\tR =      .000 deg\n};\n/END\n"},
      {Dialect::kInform,
       "/JOB\n//NAME D\n//POS\n///NPOS 2,0,0,0,0,0\n///TOOL 1\n///POSTYPE BASE\n///RECTAN\n"
       "///RCONF 1,0,0,0,0,0,0,0\nC00000=1800.000,-300.000,1200.000,0.0000,90.0000,0.0000\n"
       "C00001=1800.000,-250.000,1200.000,0.0000,90.0000,0.0000\n//INST\n///DATE 2026/11/22 "
       "10:00\n///ATTR SC,RW\n///GROUP1 RB1\nNOP\nMOVJ C00000 VJ=50.00 PL=3\n"
       "MOVL C00001 V=100.0\nEND\n"},
      {Dialect::kUrScript,
       "def d():\n  set_tcp(p[0.1, 0, 0.15, 0, -0.785398163, 0])\n"
       "  movej([-0.17, 0.1, 0.2, -0.2, 0.6, 0.1], a=1.4, v=1.05, r=0.01)\n"
       "  movel(p[1.8, -0.25, 1.2, 0, 1.570796327, 0], a=1.2, v=0.05)\nend\n"}};
}

/// Joints 1 to 3 have play: a target whose sides of approach are not said is known to 0.2 mm, else
/// to 0.01 mm.
Result<exchange::Answer<exchange::CorrectedTarget>> with_play(
    const std::string& tool, const std::string& payload,
    const std::vector<exchange::AskedTarget>& targets) {
  auto answer = test::shift(tool, payload, targets);
  for (std::size_t k = 0; k < targets.size(); ++k) {
    exchange::CorrectedTarget& item = answer->items[k];
    item.commanded = targets[k].pose;
    item.joints_deg = in_degrees(Coordinates::kJointRadians, targets[k].seed_rad);
    if (!targets[k].approach.directions.empty()) continue;
    item.sigma_mm = 0.2;
    item.error_after_mm = 0.35;
  }
  return answer;
}

const std::vector<TakeUp> kPlay = {{0, 2e-3, 1}, {1, 2e-3, 1}, {2, 2e-3, 1}};

LeadInOptions options_to(double tolerance_mm) {
  return {kPlay, [tolerance_mm](const exchange::CorrectedTarget& item) {
            return item.error_after_mm < tolerance_mm;
          }};
}

ReadOptions reading() {
  ReadOptions options;
  const Pose X_FT = test::spindle_only().tools.at("spindle");
  options.frames = {{"UFRAME[1]", Pose::Identity()}, {"UTOOL[1]", X_FT}, {"TOOL[1]", X_FT}};
  return options;
}

CorrectedProgram corrected(const Sample& sample, double tolerance_mm) {
  CorrectProgramOptions options;
  options.tool = options.payload = "spindle";
  options.version = "0.1.0";
  options.date = "2026-11-22";
  options.lead_in = options_to(tolerance_mm);
  const Program read = read_program(sample.dialect, {{"p", sample.text}}, reading());
  auto made = correct_program(read, test::small_cell("cam")->robot, test::spindle_only(), with_play,
                              options);
  EXPECT_TRUE(made) << (made ? "" : sentence(made.error()));
  return made ? std::move(*made) : CorrectedProgram();
}

TEST(LeadInOfPrograms, IsWrittenBeforeMotionsThatStopAndByteForByteElsewhere) {
  for (const Sample& sample : samples()) {
    const CorrectedProgram made = corrected(sample, 0.1);
    SCOPED_TRACE(made.files.empty() ? "" : made.files[0].text);
    ASSERT_GT(made.lead_ins, 0u);
    std::size_t led = 0;
    for (const ReceiptRow& row : made.rows) led += static_cast<std::size_t>(row.lead_in);
    EXPECT_EQ(led, made.lead_ins) << "the receipt counts what is written";
    EXPECT_EQ(test::without_numbers(test::without_inserted(made)),
              test::without_numbers(sample.text));
    for (const ReceiptRow& row : made.rows) {
      if (row.lead_in == 0) {
        EXPECT_NE(row.message.find("no lead-in"), std::string::npos) << row.name;
      }
    }
    const Program again = read_program(sample.dialect, made.files, reading());
    EXPECT_TRUE(check_files(again));
    EXPECT_EQ(again.moves.size(), made.moves + made.lead_ins);
    EXPECT_TRUE(again.left.empty()) << again.left.front().why;
  }
}

TEST(LeadInOfPrograms, ItsPointsTurnEveryGearWithPlayOneWay) {
  const Chain robot = test::small_cell("cam")->robot;
  const ArmOfProgram arm(robot);
  for (const Sample& sample : samples()) {
    const CorrectedProgram made = corrected(sample, 0.1);
    SCOPED_TRACE(made.files[0].text);
    const Program again = read_program(sample.dialect, made.files, reading());
    const NominalTargets nominal =
        nominal_targets(again, arm, test::spindle_only(), "spindle", "spindle").value();
    ASSERT_GE(again.moves.size(), 1 + made.lead_ins);
    std::vector<JointVector> way;
    for (std::size_t m = again.moves.size() - 1 - made.lead_ins; m < again.moves.size(); ++m) {
      ASSERT_EQ(again.moves[m].targets.size(), 1u);
      const auto& q = nominal.targets[again.moves[m].targets[0]].q;
      ASSERT_TRUE(q);
      way.push_back(*q);
    }
    for (const TakeUp& one : kPlay) {
      const double all = way.back()(one.joint) - way.front()(one.joint);
      EXPECT_GE(std::abs(all), one.way - 1e-5);
      for (std::size_t k = 1; k < way.size(); ++k)
        EXPECT_GE((way[k](one.joint) - way[k - 1](one.joint)) * (all > 0 ? 1 : -1), -1e-5);
    }
  }
}

TEST(LeadInOfPrograms, AHoleThatIsDrilledFromFurtherAwayIsLedInToFromThere) {
  // The tool's axis is the base's x. Each sample comes to the hole from 50 mm before it.
  const std::pair<const char*, const char*> from[] = {
      {"1800,-300,1200", "1750,-250,1200"},
      {"X 1800.0,Y -300.0", "X 1750.0,Y -250.0"},
      {"1800.000  mm,\tY =  -300.000", "1750.000  mm,\tY =  -250.000"},
      {"1800.000,-300.000", "1750.000,-250.000"}};
  for (std::size_t k = 0; k < std::size(from); ++k) {
    Sample drilled = samples()[k];
    const auto& [beside, before] = from[k];
    drilled.text.replace(drilled.text.find(beside), std::string(beside).size(), before);
    const CorrectedProgram made = corrected(drilled, 0.1);
    SCOPED_TRACE(made.files[0].text);
    ASSERT_GT(made.lead_ins, 0u);
    const Program again = read_program(drilled.dialect, made.files, reading());
    for (std::size_t m = 1; m + 1 < again.moves.size(); ++m) {
      const double x_mm = again.targets.at(again.moves[m].targets.at(0)).numbers[0];
      EXPECT_LT(x_mm, 1755) << "the tool turns aside in front of the part, not in the hole";
    }
  }
}

TEST(LeadInOfPrograms, AJointAtZeroIsLedInToWhereTheProgramSaysNoConfiguration) {
  const Sample at_zero{Dialect::kUrScript,
                       "def d():\n  set_tcp(p[0.1, 0, 0.15, 0, -0.785398163, 0])\n"
                       "  movej([0.0, 0.1, 0.0, 0.0, 0.6, 0.0], a=1.4, v=1.05)\nend\n"};
  EXPECT_GT(corrected(at_zero, 0.1).lead_ins, 0u);
}

TEST(LeadInOfPrograms, StatusAndTurnOfAKukaAreSaidOfItsPointsToo) {
  const Sample stated{Dialect::kKrl,
                      "DEF d( )\n$TOOL={X 100.0,Y 0.0,Z 150.0,A 0.0,B -45.0,C 0.0}\n"
                      "$BASE=$NULLFRAME\n"
                      "PTP {X 1800.0,Y -250.0,Z 1200.0,A 0.0,B 90.0,C 0.0,S 2,T 35,E1 5.0}\nEND\n"};
  const CorrectedProgram made = corrected(stated, 0.1);
  ASSERT_GT(made.lead_ins, 0u) << made.rows[0].message;
  std::size_t said = 0;
  for (std::size_t at = 0;
       (at = made.files[0].text.find(",S 2,T 35,E1 5", at)) != std::string::npos; ++at)
    ++said;
  EXPECT_EQ(said, 1 + made.lead_ins) << made.files[0].text;
}

TEST(LeadInOfPrograms, AMotionThatDoesWorkAtItsEndIsNotRepeated) {
  for (const auto& [which, end, work] :
       {std::tuple(2, "FINE    ;\n/POS", "FINE SPOT[1]    ;\n/POS"),
        std::tuple(2, "FINE    ;\n/POS", "FINE TB .10sec,CALL GUN    ;\n/POS"),
        std::tuple(3, "V=100.0\n", "V=100.0 NWAIT\n")}) {
    Sample sample = samples()[static_cast<std::size_t>(which)];
    sample.text.replace(sample.text.find(end), std::string(end).size(), work);
    const CorrectedProgram made = corrected(sample, 0.1);
    EXPECT_EQ(made.lead_ins, 0u) << made.files[0].text;
    EXPECT_NE(made.rows.back().message.find("no lead-in"), std::string::npos);
  }
}

TEST(LeadInOfPrograms, WhereATargetIsNearEnoughNothingIsInserted) {
  for (const Sample& sample : samples()) {
    const CorrectedProgram made = corrected(sample, 1);
    EXPECT_EQ(made.lead_ins, 0u);
    for (const ReceiptRow& row : made.rows)
      EXPECT_EQ(row.message.find("no lead-in"), std::string::npos) << row.message;
  }
}

TEST(LeadInOfPrograms, AJobOfYaskawaCountsItsPoints) {
  const CorrectedProgram made = corrected(samples()[3], 0.1);
  EXPECT_NE(made.files[0].text.find(fmt::format("///NPOS {},0", 2 + made.lead_ins)),
            std::string::npos)
      << made.files[0].text;
}

/// sigma follows joint 6 alone, and is least at 1 rad.
Result<exchange::Answer<exchange::CorrectedTarget>> by_joint_6(
    const std::string& tool, const std::string& payload,
    const std::vector<exchange::AskedTarget>& targets) {
  auto answer = test::shift(tool, payload, targets);
  for (std::size_t k = 0; k < targets.size(); ++k) {
    exchange::CorrectedTarget& item = answer->items[k];
    item.commanded = targets[k].pose;
    item.joints_deg = in_degrees(Coordinates::kJointRadians, targets[k].seed_rad);
    item.sigma_mm = 0.01 + 0.1 * std::abs(std::sin((from_deg(item.joints_deg[5]) - 1) / 2));
  }
  return answer;
}

std::string holes(const std::string& motion) {
  std::string text =
      "def d():\n  set_tcp(p[0, 0, 0.2, 0, 0, 0])\n"
      "  movej([0.01, 0.1, 0.2, 0.02, 0.9, 0], a=1.4, v=1.05)\n";
  for (int k = 0; k < 5; ++k)
    text += fmt::format("  {}(p[1.6, {}, 1.0, 0, 3.0, 0], a=1.2, v=0.05)\n", motion, 0.1 * k);
  return text + "end\n";
}

CorrectedProgram spun(const std::string& text, bool free,
                      const AskCorrections& model = by_joint_6) {
  CorrectProgramOptions options;
  options.free_rz = free;
  options.tool = options.payload = "spindle";
  CellTools cell = test::spindle_only();
  cell.tools["spindle"] = Pose(Eigen::Translation3d(0, 0, 0.2));
  const Program read = read_program(Dialect::kUrScript, {{"d.script", text}}, {});
  return correct_program(read, test::small_cell("cam")->robot, cell, model, options).value();
}

std::vector<double> sigmas(const CorrectedProgram& made) {
  std::vector<double> all;
  for (const ReceiptRow& row : made.rows) {
    if (row.corrected() && !is_joints(row.coordinates)) all.push_back(row.sigma_mm);
  }
  std::sort(all.begin(), all.end());
  return all;
}

TEST(FreeSpin, AToolThatMayTurnIsTurnedToWhereMoreIsKnown) {
  for (const char* motion : {"movej", "movel"}) {
    const CorrectedProgram fixed = spun(holes(motion), false), free = spun(holes(motion), true);
    const std::vector<double> before = sigmas(fixed), after = sigmas(free);
    ASSERT_EQ(before.size(), 5u) << motion;
    ASSERT_EQ(after.size(), before.size()) << motion;
    EXPECT_LT(after[2], 0.7 * before[2]) << motion;
    for (std::size_t k = 0; k < free.rows.size(); ++k) {
      const ReceiptRow &was = fixed.rows[k], &is = free.rows[k];
      EXPECT_EQ(is.before, was.before);
      if (is_joints(is.coordinates)) continue;
      EXPECT_LT((is.p_B - was.p_B).norm(), 1e-9) << "the point stays";
      const Vector3 z_was = pose_of(was.coordinates, was.after).linear().col(2);
      const Vector3 z_is = pose_of(is.coordinates, is.after).linear().col(2);
      EXPECT_LT((z_is - z_was).norm(), 1e-4) << "and so does the tool's axis";
      EXPECT_NE(is.turned_deg, 0);
    }
  }
}

/// Likewise, and joint 6 cannot go to where the program wants it.
Result<exchange::Answer<exchange::CorrectedTarget>> beyond_a_limit(
    const std::string& tool, const std::string& payload,
    const std::vector<exchange::AskedTarget>& targets) {
  auto answer = by_joint_6(tool, payload, targets);
  for (exchange::CorrectedTarget& item : answer->items) {
    if (item.joints_deg[5] < 20) item.status = "joint_limit";
  }
  return answer;
}

TEST(FreeSpin, ATargetThatIsLeftIsTurnedToWhereItIsReached) {
  const CorrectedProgram fixed = spun(holes("movel"), false, beyond_a_limit);
  const CorrectedProgram free = spun(holes("movel"), true, beyond_a_limit);
  EXPECT_TRUE(sigmas(fixed).empty());
  EXPECT_EQ(sigmas(free).size(), 5u);
}

TEST(FreeSpin, TargetsOfOnePathTurnTogether) {
  const CorrectedProgram free = spun(holes("movel"), true);
  std::vector<double> turns;
  for (const ReceiptRow& row : free.rows) {
    if (!is_joints(row.coordinates)) turns.push_back(row.turned_deg);
  }
  ASSERT_EQ(turns.size(), 5u);
  for (const double turn : turns) EXPECT_EQ(turn, turns[0]);
}

}  // namespace
}  // namespace trammel::cam
