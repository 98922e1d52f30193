#include "server/compensate/model_notes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "server/base/units.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

/// cell-7 with another payload, or none; a model of it with these sources, nothing identified.
CompensatedModel model_of(const std::vector<std::string>& sources,
                          const std::map<std::string, Payload>& payloads) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->payloads = payloads;
  CompensatedModel::Parts parts;
  parts.physics = test::demand(make_physical_model(cell, sources));
  parts.q_min = JointVector::Constant(6, -1);
  parts.q_max = JointVector::Constant(6, 1);
  for (const Parameter& parameter : parts.physics.parameters())
    parts.parameters.push_back({parameter, 0, 0, true});
  const auto P = parts.physics.parameter_count();
  parts.covariance = Eigen::MatrixXd::Zero(P, P);
  parts.trained_with = {{"spindle", payloads.empty() ? "" : payloads.begin()->first}};
  return test::demand(CompensatedModel::make(std::move(parts)));
}

/// The notes beside that of a robot file that nobody has confirmed, which every cell here has.
std::vector<std::string> noted(const CompensatedModel& model) {
  std::vector<std::string> texts;
  for (const Note& note : notes_of(model))
    if (note.code != kNotConfirmed) texts.push_back(note.text);
  return texts;
}

const std::map<std::string, Payload> kHeavy = {{"spindle", {100, Vector3(0, 0, 0.1)}}};
const std::map<std::string, Payload> kWeightless = {{"spindle", {0, Vector3(0, 0, 0.1)}}};

TEST(ModelNotes, ComplianceWithoutALoadIsSaidToBeNothing) {
  for (const auto& payloads : {std::map<std::string, Payload>{}, kWeightless}) {
    for (const char* form :
         {"compliance_linear", "compliance_first_order", "compliance_equilibrium"}) {
      const std::vector<std::string> notes = noted(model_of({"base", "geometry", form}, payloads));
      ASSERT_EQ(notes.size(), 1U) << form;
      EXPECT_EQ(notes.front(),
                "gearbox compliance does nothing here: neither link masses nor a payload with a "
                "mass are given, so M3 is M2; give payloads: {NAME: {mass_kg: ..., cog_mm: [x, y, "
                "z]}} in the cell file");
    }
  }
  EXPECT_TRUE(noted(model_of({"base", "geometry", "compliance_linear"}, kHeavy)).empty());
}

TEST(ModelNotes, EverySourceThatHasNothingToActOnIsNamed) {
  const std::vector<std::string> idle = noted(model_of({"base", "link_bending:2"}, kWeightless));
  ASSERT_EQ(idle.size(), 1U);
  EXPECT_TRUE(idle.front().starts_with(
      "bending of link 2 does nothing here: neither link masses nor a payload"))
      << idle[0];
  const std::vector<std::string> stiff = noted(model_of({"base", "geometry", "payload"}, kHeavy));
  ASSERT_EQ(stiff.size(), 1U);
  EXPECT_TRUE(stiff.front().starts_with(
      "payload mass or centre of gravity does nothing here: nothing gives way under a load"))
      << stiff[0];
}

/// With one number of the arm off by `value` (SI), known to `stddev`.
CompensatedModel off_by(const std::string& name, double value, double stddev = 0) {
  CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
  for (IdentifiedParameter& one : parts.parameters) {
    if (one.parameter.name != name) continue;
    one.value = value;
    one.stddev = stddev;
  }
  return test::demand(CompensatedModel::make(parts));
}

TEST(ModelNotes, WhatNoRobotIsOffItsDrawingByWaitsForAPerson) {
  for (const auto& [name, within, beyond] :
       {std::tuple("a6", 2.9e-3, -3.1e-3), std::tuple("d4", -2.9e-3, 20e-3),
        std::tuple("alpha2", 2.9e-3, 3.1e-3), std::tuple("beta2", 2.9e-3, -3.1e-3),
        std::tuple("q5", from_deg(0.9), from_deg(-1.1))}) {
    EXPECT_FALSE(stop_of(off_by(name, within))) << name;
    const auto stop = stop_of(off_by(name, beyond));
    ASSERT_TRUE(stop) << name;
    EXPECT_EQ(stop->code, "robot_off_drawing");
    EXPECT_NE(stop->text.find(std::string(name) + " by "), std::string::npos) << stop->text;
    EXPECT_FALSE(stop_of(off_by(name, beyond, std::abs(beyond)))) << name << " is not known";
  }
}

TEST(ModelNotes, AnUnconfirmedRobotFileIsNotedLast) {
  const std::vector<Note> notes = notes_of(off_by("d4", 20e-3));
  ASSERT_EQ(notes.size(), 2U);
  EXPECT_EQ(notes.front().severity, Note::Severity::kStop);
  EXPECT_EQ(notes.back().code, kNotConfirmed);
  EXPECT_EQ(notes.back().severity, Note::Severity::kInfo);
}

TEST(ModelNotes, WhatIsLeftIsHeldAgainstTheStatedSigma) {
  const auto left = [](double times) {
    CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
    parts.training.poses = 60;
    parts.discrepancy = times * parts.physics.cell->tracker.sigma;
    parts.training.compensated.rms = times * std::sqrt(3.0) * parts.physics.cell->tracker.sigma;
    std::vector<Note> notes = notes_of(test::demand(CompensatedModel::make(parts)));
    std::erase_if(notes, [](const Note& note) { return note.code != "left_over_sigma"; });
    return notes;
  };
  EXPECT_TRUE(left(2.9).empty());
  ASSERT_EQ(left(3.1).size(), 1U);
  EXPECT_EQ(left(3.1).front().severity, Note::Severity::kWarning);
  ASSERT_EQ(left(31).size(), 1U);
  EXPECT_EQ(left(31).front().severity, Note::Severity::kStop);
}

TEST(ModelNotes, AStatedSigmaOfMoreThanTwiceWhatIsLeftIsSaidToHideTheArmsErrors) {
  const auto overstated = [](double times, int poses, double inside = 1) {
    CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
    parts.training.poses = poses;
    parts.rank = 30;
    parts.training.coverage_95_stated = inside;
    const double fitted = 1 - parts.rank / (3.0 * poses);
    parts.training.calibrated.rms =
        times * std::sqrt(3.0 * fitted) * parts.physics.cell->tracker.sigma;
    parts.discrepancy = times * parts.physics.cell->tracker.sigma;
    const std::vector<Note> notes = notes_of(test::demand(CompensatedModel::make(parts)));
    return std::any_of(notes.begin(), notes.end(),
                       [](const Note& note) { return note.code == "sigma_overstated"; });
  };
  EXPECT_TRUE(overstated(0.48, 60));
  EXPECT_FALSE(overstated(0.52, 60));
  EXPECT_FALSE(overstated(0.48, 60, 0.95)) << "rows that state a sigma of their own";
  EXPECT_FALSE(overstated(0.3, 25)) << "what is left of few is little in any case";
}

TEST(ModelNotes, WhatIsLeftOfDistancesAndTouchesIsHeldAgainstTheStatedSigma) {
  const auto left = [](double times) {
    CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
    parts.training.gauges.emplace().rows = 60;
    parts.discrepancy = parts.training.gauges->compensated =
        times * parts.physics.cell->tracker.sigma;
    std::vector<Note> notes = notes_of(test::demand(CompensatedModel::make(parts)));
    std::erase_if(notes, [](const Note& note) { return note.code != "left_over_sigma"; });
    return notes;
  };
  EXPECT_TRUE(left(2.5).empty());
  ASSERT_EQ(left(3.1).size(), 1U);
  ASSERT_EQ(left(500).size(), 1U);
  EXPECT_EQ(left(500).front().severity, Note::Severity::kStop);
  EXPECT_NE(left(500).front().text.find("are the anchors where the cell file says"),
            std::string::npos)
      << "diagnose takes no distances: " << left(500).front().text;
}

TEST(ModelNotes, PositionsThatTheDrawingHasBetterThanTheInstrumentMeasuresWereComputed) {
  const auto codes = [](double times, int poses) {
    CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
    parts.training.poses = poses;
    parts.training.nominal.rms = times * std::sqrt(3.0) * parts.physics.cell->tracker.sigma;
    std::vector<Note> notes = notes_of(test::demand(CompensatedModel::make(parts)));
    std::erase_if(notes, [](const Note& note) { return note.code != "computed_positions"; });
    return notes;
  };
  ASSERT_EQ(codes(0.02, 60).size(), 1U);
  EXPECT_EQ(codes(0.02, 60).front().severity, Note::Severity::kWarning);
  EXPECT_TRUE(codes(1.0, 60).empty()) << "a robot as good as its drawing, measured";
  EXPECT_TRUE(codes(0.02, 3).empty());
}

TEST(ModelNotes, PositionsOfAControllerThatKnowsItsArmsErrorsWereComputed) {
  const auto is_told = [](double left, int poses) {
    CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
    parts.training.poses = poses;
    parts.training.nominal.rms = 1.5e-3;
    parts.training.calibrated.rms = left;
    parts.rank = 30;
    const std::vector<Note> notes = notes_of(test::demand(CompensatedModel::make(parts)));
    return std::any_of(notes.begin(), notes.end(),
                       [](const Note& note) { return note.code == "computed_positions"; });
  };
  EXPECT_TRUE(is_told(0.5e-6, 60));
  EXPECT_FALSE(is_told(20e-6, 60)) << "a good arm, whatever sigma is stated";
  EXPECT_FALSE(is_told(0.5e-6, 12)) << "as many numbers as parameters";
}

TEST(ModelNotes, RowsThatFitNothingAreNamedAndManyOfThemWaitForAPerson) {
  CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
  parts.provenance.training_poses = 42;
  parts.suspects = {{"p9", 9, 0.03, 1000}, {"p3", 3, 0.02, 700}};
  const auto note = [&] {
    std::vector<Note> notes = notes_of(test::demand(CompensatedModel::make(parts)));
    std::erase_if(notes, [](const Note& one) { return one.code != "rows_do_not_fit"; });
    return notes.empty() ? Note{} : notes.front();
  };
  EXPECT_EQ(note().severity, Note::Severity::kWarning);
  EXPECT_EQ(note().text,
            "2 of the measured rows do not fit the others, by up to 30 mm, and hardly count: rows "
            "3, 9; measure them again");
  for (int row = 10; row < 20; ++row) parts.suspects.push_back({"more", row, 0.01, 300});
  EXPECT_EQ(note().severity, Note::Severity::kStop);
  parts.suspects.clear();
  EXPECT_TRUE(note().code.empty());
}

TEST(ModelNotes, ABaseWhoseTurnThePosesDoNotTellWaitsForAPerson) {
  CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
  parts.unidentifiable.push_back(
      {0, {"gamma0", "beta0", "alpha0"}, "they hardly tell how the base is turned"});
  EXPECT_FALSE(stop_of(test::demand(CompensatedModel::make(parts)))) << "the cell says it";
  auto anywhere = std::make_shared<Cell>(*parts.physics.cell);
  anywhere->X_WB.reset();
  parts.physics.cell = anywhere;
  const auto stop = stop_of(test::demand(CompensatedModel::make(parts)));
  ASSERT_TRUE(stop);
  EXPECT_EQ(stop->code, "base_turn_untold");
}

TEST(ModelNotes, AnArmThatWasMeasuredAtOnePlaceWaitsForAPersonWithABaseThatIsToldToo) {
  CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
  MeasurementBatch batch;
  for (int i = 0; i < 30; ++i) {
    Measurement m;
    m.context.q = JointVector::Constant(parts.physics.cell->robot.size(), 0.02 * i);
    m.context.tool = parts.physics.cell->tools.begin()->first;
    m.p_W = Vector3(0.6, 0.15, 0.5 + 1e-5 * i);
    batch.measurements.push_back(m);
  }
  parts.measured = what_was_measured(parts.physics, batch);
  const auto stop = stop_of(test::demand(CompensatedModel::make(parts)));
  ASSERT_TRUE(stop);
  EXPECT_EQ(stop->code, "one_place");
  for (std::size_t i = 0; i < 30; ++i)
    batch.measurements[i].p_W.x() += 0.02 * static_cast<double>(i);
  parts.measured = what_was_measured(parts.physics, batch);
  EXPECT_FALSE(stop_of(test::demand(CompensatedModel::make(parts)))) << "all over the workspace";
}

std::optional<Note> note_of(const CompensatedModel::Parts& parts, const std::string& code) {
  for (Note& note : notes_of(test::demand(CompensatedModel::make(parts))))
    if (note.code == code) return std::move(note);
  return std::nullopt;
}

TEST(ModelNotes, ABaseThatStandsElsewhereThanTheCellFileHasItLeadsWithItsPlace) {
  const auto moved = [](double metres, double turn) {
    CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
    parts.physics.values.head<6>() << 0, metres, 0, turn, 0, 0;
    return parts;
  };
  const std::vector<Note> notes = notes_of(test::demand(CompensatedModel::make(moved(3, kPi))));
  ASSERT_FALSE(notes.empty());
  EXPECT_EQ(notes.front().code, "base_elsewhere");
  EXPECT_EQ(notes.front().severity, Note::Severity::kWarning);
  const std::string& text = notes.front().text;
  EXPECT_NE(text.find("stands 3000 mm from where the cell file has it, turned by 180.0 deg"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("xyz_mm: [0.0, 3000.0, 0.0]"), std::string::npos) << text;
  EXPECT_TRUE(note_of(moved(0, kPi), "base_elsewhere")) << "turned where it stands";
  const auto near = note_of(moved(0.02, 0), "base_elsewhere");
  ASSERT_TRUE(near) << "a measured base, and 20 mm too much in the robot file's first length";
  EXPECT_EQ(near->severity, Note::Severity::kInfo);
  EXPECT_FALSE(note_of(moved(0.002, 0), "base_elsewhere"));
  CompensatedModel::Parts anew = moved(3, 0);
  anew.provenance.refits.push_back({"m", {"base"}, "b", "h", 10});
  EXPECT_FALSE(note_of(anew, "base_elsewhere")) << "somebody asked for it to be found anew";
}

TEST(ModelNotes, ABaseThatIsOffAsAWrongFirstLengthWouldMakeItWaitsForAPerson) {
  const auto moved = [](double aside, double along, double about) {
    CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
    parts.physics.values.head<6>() << aside, 0, along, about, 0, 0;
    return note_of(parts, "base_elsewhere");
  };
  const auto longer = moved(0, 18e-3, 0);
  ASSERT_TRUE(longer);
  EXPECT_EQ(longer->severity, Note::Severity::kStop);
  EXPECT_NE(longer->text.find("18.0 mm in its first length"), std::string::npos) << longer->text;
  const auto turned = moved(0, 0, from_deg(2));
  ASSERT_TRUE(turned);
  EXPECT_EQ(turned->severity, Note::Severity::kStop);
  EXPECT_NE(turned->text.find("2.00 deg in the zero of joint 1"), std::string::npos)
      << turned->text;
  EXPECT_EQ(moved(0.1, 18e-3, 0)->severity, Note::Severity::kWarning) << "it stands elsewhere";
}

TEST(ModelNotes, RoundedMeasurementsAreHeldAgainstTheStatedSigma) {
  CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
  parts.measured.emplace().approaches.resize(6);
  parts.measured->flange_B = Eigen::Matrix3Xd::Zero(3, 1);
  EXPECT_FALSE(note_of(parts, "measurements_rounded"));
  parts.measured->rounding = Rounding{0.1e-3, 0.013e-3, false};
  const auto note = note_of(parts, "measurements_rounded");
  ASSERT_TRUE(note);
  EXPECT_NE(note->text.find("positions are whole multiples of 0.1 mm, which alone makes 0.029 mm"),
            std::string::npos)
      << note->text;
}

TEST(ModelNotes, JointsThatADisplayRoundedAreNamedWhereMuchIsLeft) {
  CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
  parts.measured.emplace().approaches.resize(6);
  parts.measured->flange_B = Eigen::Matrix3Xd::Zero(3, 1);
  parts.training.poses = 60;
  parts.discrepancy = 0.4e-3;
  parts.training.compensated.rms = 0.7e-3;
  parts.measured->joint_rounding = {from_deg(0.1), 0.35e-3};
  auto note = note_of(parts, "left_over_sigma");
  ASSERT_TRUE(note);
  EXPECT_NE(note->text.find("whole multiples of 0.1 deg"), std::string::npos) << note->text;
  parts.measured->joint_rounding->stddev = 0.01e-3;
  EXPECT_EQ(note_of(parts, "left_over_sigma")->text.find("whole multiples"), std::string::npos);
}

TEST(ModelNotes, WhatIsLeftIsHeldAgainstTheSigmaThatTheRowsState) {
  CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
  parts.training.poses = 60;
  parts.training.compensated.rms = std::sqrt(3.0) * parts.physics.cell->tracker.sigma;
  parts.discrepancy = parts.physics.cell->tracker.sigma;
  parts.measured.emplace().approaches.resize(6);
  parts.measured->flange_B = Eigen::Matrix3Xd::Zero(3, 1);
  EXPECT_FALSE(note_of(parts, "left_over_sigma"));
  parts.measured->stated = 0.02e-6;
  const auto note = note_of(parts, "left_over_sigma");
  ASSERT_TRUE(note) << "sigma_mm in metres";
  EXPECT_EQ(note->severity, Note::Severity::kStop);
}

TEST(ModelNotes, OrientationsFarBeyondTheirStatedSigmaAreSaid) {
  CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
  const double sigma = parts.physics.cell->tracker.sigma_rotation;
  parts.training.orientation.emplace().poses = 60;
  parts.training.orientation->compensated = 3 * std::sqrt(3.0) * sigma;
  EXPECT_FALSE(note_of(parts, "orientations_left_over"));
  parts.training.orientation->compensated = 57 * std::sqrt(3.0) * sigma;
  const auto note = note_of(parts, "orientations_left_over");
  ASSERT_TRUE(note) << "sigma_deg in radians";
  EXPECT_NE(note->text.find("57 times"), std::string::npos) << note->text;
}

TEST(ModelNotes, LengthsThatAreAllOffByOneShareAreSaidWithWhatMayMakeThemSo) {
  const auto scaled = [](double share, double scatter) {
    CompensatedModel::Parts parts = model_of({"base", "geometry"}, kHeavy).parts();
    const Chain& robot = parts.physics.cell->robot;
    double sign = 1;
    for (std::size_t i = 0; i < parts.parameters.size(); ++i) {
      IdentifiedParameter& one = parts.parameters[i];
      const std::string& name = one.parameter.name;
      if (name.size() != 2 || (name[0] != 'a' && name[0] != 'd')) continue;
      const LinkGeometry& link = robot.joint(name[1] - '1').link;
      one.value = share * (name[0] == 'a' ? link.a : link.d) + (sign *= -1) * scatter;
      parts.physics.values(static_cast<Eigen::Index>(i)) = one.value;
      one.stddev = 30e-6;
      parts.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)) = 1e-9;
    }
    return parts;
  };
  const auto note = note_of(scaled(5e-4, 0), "lengths_scaled");
  ASSERT_TRUE(note);
  EXPECT_EQ(note->severity, Note::Severity::kWarning);
  EXPECT_NE(note->text.find("about 0.05 % longer than drawn"), std::string::npos) << note->text;
  EXPECT_NE(note->text.find("the instrument's scale"), std::string::npos) << note->text;
  EXPECT_NE(note->text.find("42 K warmer"), std::string::npos) << note->text;
  const auto beyond = note_of(scaled(1e-3, 0), "lengths_scaled");
  ASSERT_TRUE(beyond);
  EXPECT_EQ(beyond->severity, Note::Severity::kStop) << "no warmth makes an arm 0.1 % longer";
  EXPECT_TRUE(note_of(scaled(1e-3, 20e-6), "lengths_scaled"));
  EXPECT_TRUE(note_of(scaled(-5e-4, 10e-6), "lengths_scaled"));
  EXPECT_FALSE(note_of(scaled(0, 0.3e-3), "lengths_scaled")) << "errors of making";
  EXPECT_FALSE(note_of(scaled(1e-4, 0), "lengths_scaled")) << "as warm as arms are";
}

TEST(ModelNotes, ASourceThatActsIsNot) {
  const std::vector<std::string> all = {"base",
                                        "geometry",
                                        "tool",
                                        "joint_map:3@2",
                                        "backlash:2",
                                        "thermal_growth",
                                        "wrist_coupling",
                                        "gear_transmission:1@48",
                                        "time_lag",
                                        "joint_slip:1@40",
                                        "tracker_drift",
                                        "encoder_eccentricity:2",
                                        "tracker_moved@9",
                                        "link_bending:2",
                                        "compliance_linear"};
  const std::vector<std::string> notes = noted(model_of(all, kHeavy));
  EXPECT_TRUE(notes.empty()) << notes.front();
}

Evaluation compared(double without, double with, std::optional<double> z) {
  Evaluation evaluation;
  evaluation.poses = 1000;
  evaluation.calibrated.rms = without;
  evaluation.compensated.rms = with;
  evaluation.bias_gain_z = z;
  return evaluation;
}

TEST(DoubtOfBias, SaysThatABiasThatMakesItWorseDoesNotHelp) {
  EXPECT_EQ(doubt_of_bias(compared(22.9e-6, 23.3e-6, -4.0)).value(),
            "the bias does not help here: 0.0233 mm with it, 0.0229 mm without on 1000 poses");
  // A model from before the pairs were kept.
  EXPECT_EQ(doubt_of_bias(compared(22.9e-6, 23.3e-6, {})).value(),
            "the bias does not help here: 0.0233 mm with it, 0.0229 mm without on 1000 poses");
}

TEST(DoubtOfBias, SaysWhatIsNoMoreThanChance) {
  EXPECT_EQ(doubt_of_bias(compared(23.3e-6, 22.9e-6, 1.1)).value(),
            "the bias is not shown to help here: 0.0229 mm with it, 0.0233 mm without on 1000 "
            "poses, no more than chance would make of it");
  EXPECT_FALSE(doubt_of_bias(compared(0.48e-3, 0.2e-3, 20)));
  EXPECT_FALSE(doubt_of_bias(compared(22.9e-6, 22.9e-6, {})));  // no bias
}

}  // namespace
}  // namespace trammel
