#!/usr/bin/env python3
"""Writes robot programs in the manner of shops, corrects them, and computes by itself where the arm lands.

    tests/benchmarks/shop_floor.py [--count N] [--keep FOLDER] [DIALECT]

It writes N programs (24) of each dialect from a fixed seed: KUKA backups with their own bas.src, FANUC spot welding with a gun axis
and SYSFRAME.VA, RAPID in the layout of posts, INFORM with pulses and frames, UR scripts with threads. It knows what each motion
means, since it chose the joints. It prints the share of motions that `trammel correct` corrects, each other reason with its count,
and how far the tool lands from where the program sends it, by a chain of its own (NumPy, second_reader.py). A virtual robot is
measured without noise, so that what is left is the program's own: a landing beyond 0.001 mm, or a motion that is corrected though it
must not be, is wrong. What it takes on trust: the first number of a Yaskawa's RCONF, which the jobs write as the program reads it (1: the
wrist bends the tool down); with 0 in the same jobs each of their poses lands off by 0.54 mm, since the other wrist is meant. The manual
of the NX100 counts it by axis R, which is the other way round, so that this benchmark does not prove that reading. Exit code 1: something is wrong, or a dialect is below its share. FOLDER keeps what was written.
TRAMMEL_BUILD: where the build is (build/release).
"""
import argparse
import collections
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np
import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import second_reader as second  # noqa: E402

ROOT = second.ROOT
NEAR_MM = 0.001
TRUTH = {"version": 1,
         "error_sources": {"geometry": {"q2_rad": -8.2e-4, "q3_rad": -9.2e-4, "q4_rad": -7e-4, "q5_rad": 9e-4, "a1_mm": -0.3, "a2_mm": 0.4,
                                        "a3_mm": -0.3, "alpha1_rad": -2.6e-4, "alpha3_rad": 4e-4}},
         "noise": {"sigma_mm": 1e-7, "sigma_deg": 1e-8}}
# The robot, the tool in mm, the joints that the programs work around in deg, and the share that is due in %.
CELLS = {"krl": ("kuka_kr210-r2700-extra", 200, [10, -80, 95, 15, 50, -20], 85),
         "fanuc": ("fanuc_m-20ia", 200, [10, 15, -10, 12, -60, 25], 80),
         "rapid": ("abb_irb6640-205-275", 200, [10, 10, 10, 15, 40, 20], 95),
         "inform": ("yaskawa_gp25", 200, [10, 15, -10, 12, -60, 25], 90),
         "urscript": ("universal-robots_ur10", 100, [10, -70, 90, -100, -80, 30], 80)}


def angles_zyx(turned):
    """deg about z, y, x."""
    return np.degrees([math.atan2(turned[1, 0], turned[0, 0]), math.atan2(-turned[2, 0], math.hypot(turned[0, 0], turned[1, 0])),
                       math.atan2(turned[2, 1], turned[2, 2])])


def quaternion(turned):
    w = math.sqrt(max(0, 1 + turned[0, 0] + turned[1, 1] + turned[2, 2])) / 2
    if w > 0.3:
        return np.array([w, (turned[2, 1] - turned[1, 2]) / (4 * w), (turned[0, 2] - turned[2, 0]) / (4 * w), (turned[1, 0] - turned[0, 1]) / (4 * w)])
    values, vectors = np.linalg.eigh(turned + turned.T)
    axis, angle = vectors[:, -1], math.acos(np.clip((np.trace(turned) - 1) / 2, -1, 1))
    if second.of_quaternion((0, 0, 0), [math.cos(angle / 2), *(math.sin(angle / 2) * axis)])[:3, :3] @ turned.T @ np.ones(3) @ np.ones(3) < 2.999:
        axis = -axis
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])


def vector_of(turned):
    w, *xyz = quaternion(turned)
    sine = np.linalg.norm(xyz)
    return np.zeros(3) if sine < 1e-12 else np.array(xyz) / sine * 2 * math.atan2(sine, w)


class Job:
    """A program: its files, and what the motions mean."""

    def __init__(self, arm, tool, around, random):
        self.arm, self.tool, self.around, self.random = arm, tool, np.radians(around), random
        self.files, self.meant, self.lines = {}, [], []

    def joints(self, spread=1.0):
        return self.around + np.radians(self.random.uniform(-1, 1, 6) * [18, 9, 9, 15, 12, 25]) * spread

    def say(self, *lines):
        self.lines += lines

    def close(self, name, end="\r\n"):
        self.files[name] = end.join(self.lines) + end
        self.lines = []

    def mean(self, numbers, kind, frame, q):
        """A target by its numbers as they are written; `q`: the joints that it was made of."""
        self.meant.append((kind, np.array(numbers, float), np.array(frame), np.array(q), self.tool))

    def pose(self, q, frame):
        return np.linalg.inv(frame) @ self.arm.flange(q) @ self.tool

    def zyx(self, q, frame, kind):
        """x y z and three angles, three decimals: A B C of a KUKA, W P R of the others."""
        pose = self.pose(q, frame)
        angles = angles_zyx(pose[:3, :3])
        numbers = np.round([*pose[:3, 3], *(angles if kind == "mm_abc_deg" else angles[::-1])], 3 if kind == "mm_abc_deg" else 3)
        self.mean(numbers, kind, frame, q)
        return numbers

    def axes(self, q, kind="joints_deg"):
        numbers = np.round(np.degrees(q), 3)
        self.mean(numbers, kind, np.eye(4), np.radians(numbers))
        return numbers


def some_frame(random, height=400):
    return second.of_zyx(*np.round(random.uniform([-50, -300, height - 100], [250, 300, height + 100]), 2), *np.round(random.uniform(-5, 5, 3), 2))


# ---- KUKA

BAS = """&ACCESS RV
DEF  BAS (COMMAND :IN,REAL_PAR :IN )
DECL BAS_COMMAND COMMAND
REAL REAL_PAR
SWITCH  COMMAND
CASE #INITMOV
  GLOBAL_INIT( )
CASE #TOOL
  $TOOL=TOOL_DATA[REAL_PAR]
  $LOAD=LOAD_DATA[REAL_PAR]
CASE #BASE
  $BASE=BASE_DATA[REAL_PAR]
ENDSWITCH
END
"""


def krl_text(names, numbers):
    return "{" + ",".join(f"{name} {number:.3f}" for name, number in zip(names, numbers))


def krl_turns(q):
    return f"S {2 + (4 if q[4] < 0 else 0)},T {sum(1 << j for j in range(6) if q[j] < 0)}"


def krl(job, at):
    random, name = job.random, f"op{at:02}"
    frame = some_frame(random)
    home = np.radians([0, -90, 90, 0, 45, 0])
    config = ["&ACCESS RVP", "DEFDAT  $CONFIG PUBLIC", "DECL FRAME TOOL_DATA[16]", "DECL FRAME BASE_DATA[32]", "DECL LOAD LOAD_DATA[16]",
              "TOOL_DATA[1]={X 0.0,Y 0.0,Z 200.0,A 0.0,B 0.0,C 0.0}", 'TOOL_NAME[1,]="spindle"',
              "BASE_DATA[3]=" + krl_text("XYZABC", [*frame[:3, 3], *angles_zyx(frame[:3, :3])]) + "}",
              "LOAD_DATA[1]={M -1.0,CM {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}",
              "DECL FDAT FHOME={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] \" \",TQ_STATE FALSE}",
              "DECL PDAT PDEFAULT={VEL 100.0,ACC 100.0,APO_DIST 100.0}",
              "E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 45.0,A6 0.0,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}", "ENDDAT"]
    job.say(*config)
    job.close("KRC/R1/System/$config.dat")
    job.files["KRC/R1/System/bas.src"] = BAS
    job.say("&ACCESS RV", "DEFDAT  $MACHINE PUBLIC", '$TRAFONAME[]="#KR210R2700 EXTRA C4 FLR"', "INT $NUM_AX=6",
            "FRAME $ROBROOT={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}", "ENDDAT")
    job.close("KRC/R1/Mada/$machine.dat")
    job.mean(np.degrees(home), "joints_deg", np.eye(4), home)
    data, code = ["&ACCESS RVP", f"DEFDAT  {name.upper()}", "EXT  BAS (BAS_COMMAND  :IN,REAL  :IN )", "DECL INT SUCCESS"], []

    def to_home():
        code.extend([";FOLD PTP HOME  Vel= 100 % DEFAULT;%{PE}%MKUKATPBASIS,%CMOVE,%VPTP,%P 1:PTP, 2:HOME, 3:, 5:100, 7:DEFAULT",
                     "$BWDSTART = FALSE", "PDAT_ACT=PDEFAULT", "FDAT_ACT=FHOME", "BAS (#PTP_PARAMS,100 )", "$H_POS=XHOME", "PTP  XHOME", ";ENDFOLD"])

    count, style, newer = 9 + at % 8, at % 4, at % 8 >= 4
    to_home()
    for k in range(1, count):
        q = job.joints()
        numbers = job.zyx(q, frame, "mm_abc_deg")
        place = krl_text("XYZABC", numbers) + f",{krl_turns(q)},E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}}"
        word = "PTP" if k == 1 or random.random() < 0.3 else "LIN"
        if style == 3 and k > 2 and word == "LIN":  # written by a post
            code.append(f"LIN {krl_text('XYZABC', numbers)}}} C_DIS")
            continue
        data.append(f"DECL E6POS XP{k}={place}")
        data.append(f'DECL FDAT FP{k}={{TOOL_NO 1,BASE_NO 3,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}}')
        data.append(f"DECL PDAT PPDAT{k}={{VEL 100.0,ACC 100.0,APO_DIST 100.0}}" if word == "PTP" else
                    f"DECL LDAT LCPDAT{k}={{VEL 2.0,ACC 100.0,APO_DIST 100.0,APO_FAC 50.0}}")
        if style == 2 and newer:
            spline = "S" + word
            code += [f";FOLD {spline} P{k} Vel=0.2 m/s CPDAT{k} Tool[1]:spindle Base[3]:panel ;%{{PE}}", ";FOLD Parameters ;%{h}",
                     f";Params IlfProvider=kukaroboter.basistech.inlineforms.movement.spline; Kuka.PointName=P{k}; IlfCommand={spline}", ";ENDFOLD",
                     f"{spline} XP{k} WITH $VEL{'_AXIS[1] = SVEL_JOINT(100.0)' if word == 'PTP' else f' = SVEL_CP(0.2, , LCPDAT{k})'}, $TOOL = STOOL2(FP{k}), "
                     f"$BASE = SBASE(FP{k}.BASE_NO), $IPO_MODE = SIPO_MODE(FP{k}.IPO_FRAME), $LOAD = SLOAD(FP{k}.TOOL_NO)", ";ENDFOLD"]
            continue
        code.append(f";FOLD {word} P{k} {'Vel=100 % PDAT' if word == 'PTP' else 'Vel=0.2 m/s CPDAT'}{k} Tool[1]:spindle Base[3]:panel;%{{PE}}%R 8.3.38,%MKUKATPBASIS,%CMOVE,%V{word}")
        code += ["$BWDSTART=FALSE", f"{'PDAT_ACT=PPDAT' if word == 'PTP' else 'LDAT_ACT=LCPDAT'}{k}", f"FDAT_ACT=FP{k}",
                 f"BAS(#{'PTP' if word == 'PTP' else 'CP'}_PARAMS,{100 if word == 'PTP' else 0.2})", f"{word} XP{k}", ";ENDFOLD"]
        if style == 1 and k == 7 and newer:
            code += ["LIN_REL {Z -30.0} #TOOL", "USERPROC(3)"]
        if style == 1 and k % 3 == 0:
            code += ["$OUT[12]=TRUE", "WAIT FOR ($IN[14])"]
        if style == 2 and k == 4:
            code += ["IF $IN[5] THEN", "  $OUT[7]=TRUE", "ELSE", "  WAIT SEC 0.5", "ENDIF"]
    to_home()
    begin = ["&ACCESS RVP", "&REL 4", f"&PARAM TEMPLATE = C:\\KRC\\Roboter\\Template\\vorgabe", f"DEF {name}( )", ";FOLD INI;%{PE}", "  ;FOLD BASISTECH INI",
             "    GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )", "    INTERRUPT ON 3 ", "    BAS (#INITMOV,0 )", "  ;ENDFOLD (BASISTECH INI)",
             ";ENDFOLD (INI)"]
    if style == 3:
        begin += ["$TOOL=TOOL_DATA[1]", "$BASE=BASE_DATA[3]"]
    job.say(*begin, *code, "END")
    job.close(f"KRC/R1/Program/{name}.src")
    job.say(*data, "ENDDAT")
    job.close(f"KRC/R1/Program/{name}.dat")
    return []


# ---- FANUC

def fanuc(job, at):
    random, name = job.random, f"SPOT{at:02}"
    frame, gun = some_frame(random, 100), at % 3 != 2
    def system(variable, pose, number):
        numbers = [*pose[:3, 3], *angles_zyx(pose[:3, :3])[::-1]]
        text = [f"[*SYSTEM*]{variable}  Storage: SHADOW  Access: RW  : ARRAY[2,20] OF POSITION"]
        for k in range(1, 5):
            here = numbers if k == number else [0] * 6
            text += [f"    [1,{k}] =   ''  Group: 1   Config: N D B, 0, 0, 0"] if k % 2 else [f"    [1,{k}] = ", "  Group: 1   Config: N D B, 0, 0, 0"]
            text += ["  X: {:10.3f}   Y: {:10.3f}   Z: {:10.3f}".format(*here[:3]), "  W: {:10.3f}   P: {:10.3f}   R: {:10.3f}".format(*here[3:])]
        return text
    job.say(*system("$MNUFRAME", frame, 2), *system("$MNUTOOL", job.tool, 1))
    job.close("SYSFRAME.VA")
    job.files["ERRALL.LS"] = "ERRALL.LS      Robot Name F00000 01-JAN-26 12:00:00\n\n  1\" 01-JAN-26 11:59:00 \" SYST-043 TP disabled in T1/T2 mode\n"
    motions, points = ["!*** weld path ***", "WAIT NEXT PATH", "SET PATH(100)", "UFRAME_NUM=2", "UTOOL_NUM=1", "PAYLOAD[1:SSW1]", "ENTER FIXT-ZONE(1)",
                       "J PR[2:@Pounce] 100% CNT100"], []
    count = 8 + at % 7
    for k in range(1, count + 1):
        q = job.joints()
        group = ["   GP2:", "\tUF : 2, UT : 1,", f"\tJ1=  {random.uniform(5, 60):8.3f}  mm"] if gun else []
        if k in (1, count):
            axes = job.axes(q)
            points.append([f"P[{k}]{{", "   GP1:", "\tUF : 2, UT : 1,\t", "\tJ1= {:9.3f} deg,\tJ2= {:9.3f} deg,\tJ3= {:9.3f} deg,".format(*axes[:3]),
                           "\tJ4= {:9.3f} deg,\tJ5= {:9.3f} deg,\tJ6= {:9.3f} deg".format(*axes[3:]), *group, "};"])
            motions.append(f"J P[{k}] 100% FINE")
            continue
        numbers = job.zyx(q, frame, "mm_wpr_deg")
        points.append([f"P[{k}]{{" if k % 2 else f"P[{k}:\"SP{k}\"]{{", "   GP1:", "\tUF : 2, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',",
                       "\tX = {:9.3f}  mm,\tY = {:9.3f}  mm,\tZ = {:9.3f}  mm,".format(*numbers[:3]),
                       "\tW = {:9.3f} deg,\tP = {:9.3f} deg,\tR = {:9.3f} deg".format(*numbers[3:]), *group, "};"])
        label = f"P[{k}]" if k % 2 else f"P[{k}:SP{k}]"
        if k == 2:
            motions.append(f"J {label} 100% CNT50")
        elif gun and k % 2 == 0:
            motions.append(f"CALL SW_WELD(1,{20700 + k})")
            motions.append(f"L {label} 1200mm/sec FINE\n    :  SPOT[SD=1,P=1,t=2.0,S={k},ED=1]")
        else:
            motions.append(f"L {label} 800mm/sec CNT100")
        if k % 4 == 0:
            motions.append("WAIT DI[12]=ON")
        if at % 4 == 1 and k == 5:
            motions += ["!Exit Zone 5", "EXIT I-ZONE(5)", "R[31:Retry]=R[31:Retry]+1", "IF (DI[34:DryCycle]=ON),$SPOTCONFIG.$STROKE_ENBL=0"]
        if at % 4 == 3 and k == 3:
            motions += ["IF R[5:Style]<>2,JMP LBL[10]", "LBL[10:Weld]"]
    job.say(f"/PROG  {name}", "/ATTR", "OWNER\t\t= MNEDITOR;", 'COMMENT\t\t= "side panel";', "PROG_SIZE\t= 1200;", f"LINE_COUNT\t= {len(motions)};",
            f"DEFAULT_GROUP\t= 1,{1 if gun else '*'},*,*,*;", "/APPL", "  SPOT : TRUE ;", "/MN", *[f"{n:4}:{'' if line[0] in 'JL' and line[1] == ' ' else '  '}{line}    ;" for n, line in enumerate(motions, 1)],
            "/POS", *[line for point in points for line in point], "/END")
    job.close(f"{name}.LS")
    return ["--idle-axis", "group 2, axis 1"] if gun else []


# ---- ABB

def rapid(job, at):
    random, name, style = job.random, f"Part{at:02}", at % 3
    frame = some_frame(random, 500)
    q_frame = np.round(quaternion(frame[:3, :3]), 9)
    frame = second.of_quaternion(frame[:3, 3], q_frame)
    job.say("%%%", "  VERSION:1", "  LANGUAGE:ENGLISH", "%%%", "") if style == 2 else None
    job.say(f"MODULE {name}", "    ! Generated by a post processor",
            "    PERS tooldata Tool1:=[TRUE,[[0,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];",
            '    PERS wobjdata Wobj1:=[FALSE,TRUE,"",[[{:g},{:g},{:g}],[{:.9f},{:.9f},{:.9f},{:.9f}]],[[0,0,0],[1,0,0,0]]];'.format(*frame[:3, 3], *q_frame))
    start = job.joints()
    axes = job.axes(start)
    body = ["MoveAbsJ [[{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f}],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v500,z10,Tool1;".format(*axes)]
    if style == 1:
        body = ["Tool1.tframe:=[[0,0,200],[1,0,0,0]];"] + body
    external = "[9E9,9E9,9E9,9E9,9E9,9E9]"
    for k in range(1, 12 + at % 20):
        q = job.joints()
        pose = job.pose(q, frame)
        xyz, wxyz = np.round(pose[:3, 3], 3), np.round(quaternion(pose[:3, :3]), 8)
        job.mean([*xyz, *wxyz], "mm_wxyz", frame, q)
        quarters = [math.floor(math.degrees(q[j]) / 90) for j in (0, 3, 5)]
        target = "[[{:.3f},{:.3f},{:.3f}],[{:.8f},{:.8f},{:.8f},{:.8f}],[{},{},{},0],{}]".format(*xyz, *wxyz, *quarters, external)
        word = "MoveJ" if k == 1 else "MoveL"
        if style == 0:
            job.say(f"    CONST robtarget p{k}:={target};")
            target = f"p{k}"
        body.append(f"{word} {target},v{random.choice([50, 100, 500])},{random.choice(['fine', 'z1', 'z5'])},Tool1\\WObj:=Wobj1;")
    job.say("", "    PROC main()", "        ConfJ\\Off;", "        ConfL\\Off;", *["        " + line for line in body], "    ENDPROC", "ENDMODULE")
    job.close(f"{name}.mod")
    return []


# ---- Yaskawa

PULSES = [1341.4, 1341.4, 1341.4, 1000.0, 1000.0, 622.0]


def inform(job, at):
    random, name, style = job.random, f"JOB{at:02}", at % 3
    frame = some_frame(random, 100)
    numbers = np.round([*frame[:3, 3], *angles_zyx(frame[:3, :3])[::-1]], 4)
    frame = second.of_zyx(*numbers[:3], *numbers[:2:-1])
    tool = ["//TOOL 0", "///NAME SPINDLE", "0.000,0.000,200.000,0.0000,0.0000,0.0000", "0.000,0.000,0.000", "0.000", "0.000,0.000,0.000"]
    job.say(*tool)
    job.close("TOOL.CND")
    job.say("//UFRAME 1", "///NAME FIXTURE", "///TOOL 0", "///GROUP 1,0", "///PULSE", *(["0,0,0,0,0,0"] * 3), "////BUSER " + ",".join(f"{n:.4f}" for n in numbers))
    job.close("UFRAME.CND")
    count = 8 + at % 9
    positions, motions = [], []
    pulses = style == 2 or at % 4 == 1
    for k in range(count):
        q = job.joints()
        if style == 2 or (pulses and k == 0):
            counts = np.round(np.degrees(q) * PULSES)
            job.mean(counts, "joints_pulses", np.eye(4), np.radians(counts / PULSES))
            positions.append((f"C{k:05}=" + ",".join(f"{n:.0f}" for n in counts), "pulse"))
        else:
            n = job.zyx(q, frame, "mm_wpr_deg")
            positions.append((f"C{k:05}=" + ",".join(f"{v:.3f}" for v in n[:3]) + "," + ",".join(f"{v:.4f}" for v in n[3:]), "user"))
        motions.append(f"MOVJ C{k:05} VJ=50.00" if k < 2 else f"MOVL C{k:05} V={random.choice([50.0, 138.0, 500.0]):.1f}" + (" PL=0" if k % 3 else ""))
        if k % 4 == 2:
            motions += ["DOUT OT#(12) ON", "TIMER T=0.50"]
    job.say("/JOB", f"//NAME {name}", "//POS", f"///NPOS {count},0,0,0,0,0", "///TOOL 0")
    kind = ""
    for text, which in positions:
        if which != kind:
            job.say(*(["///POSTYPE PULSE", "///PULSE"] if which == "pulse" else ["///USER 1", "///POSTYPE USER", "///RECTAN", "///RCONF 1,0,0,0,0,0,0,0"]))
            kind = which
        job.say(text)
    job.say("//INST", "///DATE 2026/01/07 10:00", "///ATTR SC,RW", "///GROUP1 RB1", "NOP", *motions, "END")
    job.close(f"{name}.JBI")
    return ["--pulses-per-deg", ",".join(map(str, PULSES))] if pulses else []


# ---- UR

def urscript(job, at):
    style, digits = at % 6, 6 if at % 2 else 9
    tool = "p[0.0,0.0,0.1,0.0,0.0,0.0]"
    body = [f"set_tcp({tool})", "set_payload(1.2)", "set_gravity([0.0, 0.0, 9.82])"]
    before = []
    if style == 1:
        before += ["  thread watch():", "    while (True):", "      if get_digital_in(3):", "        set_digital_out(4, True)", "      end", "      sync()", "    end", "    return False",
                   "  end", "  threadId_watch = run watch()"]
    q = job.joints()
    count = 9 + at % 9
    for k in range(count):
        if k == 0 or style == 3 and k % 3 == 0 or k == count - 1:
            q = np.round(job.joints(), digits)
            job.mean(q, "joints_rad", np.eye(4), q)
            body.append("movej([{}], a=1.3962634015954636, v=1.0471975511965976)".format(", ".join(f"{one:.{digits}f}" for one in q)))
            continue
        q = job.joints()
        pose = job.pose(q, np.eye(4))
        numbers = np.round([*(pose[:3, 3] / 1000), *vector_of(pose[:3, :3])], digits)
        job.mean(numbers, "m_rotvec_rad", np.eye(4), q)
        text = "p[" + ", ".join(f"{one:.{digits}f}" for one in numbers) + "]"
        if style == 2 and k % 4 == 1:  # a joint motion to a point, near to joints of full resolution
            before += [f"  global Waypoint_{k}_p={text}", f"  global Waypoint_{k}_q=[{', '.join(map(repr, map(float, q)))}]"]
            body += ['$ 3 "MoveJ"', f'$ 4 "Waypoint_{k}" "breakAfter"',
                     f"movej(get_inverse_kin(Waypoint_{k}_p, qnear=Waypoint_{k}_q), a=1.3962634015954636, v=1.0471975511965976)"]
            continue
        if style == 2:
            before.append(f"  global Waypoint_{k}_p={text}")
            text = f"Waypoint_{k}_p"
        if style in (0, 4) and k == 4:
            body.append(f"set_tcp({tool})")
        if style == 4 and k in (5, 6):  # a probe, which the cell does not have
            job.meant.pop()
            body.append("set_tcp(p[0.0,0.03,0.21,0.0,0.0,0.0])")
            body.append(f"movel({text}, a=1.2, v=0.25)")
            body.append(f"set_tcp({tool})")
            continue
        if style == 5 and k == 3:  # where force or a sensor moves the arm, nothing may be corrected
            job.meant.pop()
            body += ["force_mode(tool_pose(), [0, 0, 1, 0, 0, 0], [0.0, 0.0, -20.0, 0.0, 0.0, 0.0], 2, [0.1, 0.1, 0.15, 0.35, 0.35, 0.35])",
                     f"movel({text}, a=1.2, v=0.01)", "end_force_mode()", "stopl(5.0)"]
            continue
        body.append(f"movel({text}, a=1.2, v=0.25{', r=0.002' if k % 3 == 0 and k + 2 < count else ''})")
    if style in (2, 3):
        body = body[:3] + ["while (True):", *["  " + line for line in body[3:]], "end"]
    job.say(f"def part_{at:02}():", "  set_standard_analog_input_domain(0, 1)", "  step_count_b868 = 0.0", "  thread Step_Counter_Thread_04f9():", "    while (True):",
            "      step_count_b868 = step_count_b868 + 1.0", "      sync()", "    end", "  end", "  run Step_Counter_Thread_04f9()", *before,
            *["  " + line for line in body], "end", f"part_{at:02}()")
    job.close(f"part_{at:02}.script", "\n")
    return []


WRITERS = {"krl": krl, "fanuc": fanuc, "rapid": rapid, "inform": inform, "urscript": urscript}


def commanded(kind, numbers, frame):
    """The pose of the tool in the robot's base; of axes nothing."""
    if kind == "mm_wxyz":
        return frame @ second.of_quaternion(numbers[:3], numbers[3:])
    if kind == "mm_abc_deg":
        return frame @ second.of_zyx(*numbers)
    if kind == "mm_wpr_deg":
        return frame @ second.of_zyx(*numbers[:3], *numbers[:2:-1])
    if kind == "m_rotvec_rad":
        return frame @ second.of_vector(1000 * numbers[:3], numbers[3:])
    return None


def joints_of(kind, numbers):
    return {"joints_deg": np.radians(numbers), "joints_rad": numbers, "joints_pulses": np.radians(numbers / PULSES)}[kind]


def landing(drawing, true, meant, after):
    """mm between where the tool lands and where the program sends it."""
    kind, numbers, frame, q, tool = meant
    wanted = commanded(kind, numbers, frame)
    if wanted is None:
        wanted, q = drawing.flange(joints_of(kind, numbers)) @ tool, joints_of(kind, after)
    else:
        q = drawing.solve(commanded(kind, after, frame) @ np.linalg.inv(tool), q)
    return math.inf if q is None else float(np.linalg.norm((true.flange(q) @ tool)[:3, 3] - wanted[:3, 3]))


def run(*command):
    return subprocess.run([second.TRAMMEL, *map(str, command)], capture_output=True, text=True)


def model_of(dialect, folder):
    robot, tool, _, _ = CELLS[dialect]
    cell = folder / f"{dialect}.yaml"
    cell.write_text(f"version: 1\ncell: {dialect}\nrobot: {ROOT}/models/{robot}.yaml\nbase: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}}\n"
                    f"gravity: [0, 0, -1]\ntools:\n  spindle: {{xyz_mm: [0, 0, {tool}], q_wxyz: [1, 0, 0, 0]}}\n"
                    "model: {error_sources: [geometry], bias: none}\n")
    truth = folder / "truth.yaml"
    truth.write_text(yaml.safe_dump(TRUTH))
    plan, batch, model = (folder / f"{dialect}{ending}" for ending in (".plan.csv", ".batch.csv", ".model"))
    for command in (("plan", "--cell", cell, "--count", 60, "-o", plan), ("simulate", "--cell", cell, "--truth", truth, "--plan", plan, "-o", batch),
                    ("train", "--cell", cell, "--batch", batch, "-o", model)):
        done = run(*command)
        if done.returncode not in (0, 1):
            raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr}")
    return model


def check(job, receipt, arms, found):
    for row in receipt["targets"]:
        if "after" not in row:
            found["left"][re.sub(r"[\w./$]+ line \d+", "FILE line N", f"{row['status']}: {row['message']}")] += max(1, len(row["used_at"]))
            continue
        same = [one for one in job.meant if one[0] == row["units"] and len(one[1]) == len(row["before"]) and np.allclose(one[1], row["before"], atol=1e-9)]
        if not same:
            found["wrong"].append(f"{row['file']} line {row['line']} {row['name']}: not a target of the program")
            continue
        off = landing(*arms, same[0], np.array(row["after"]))
        if row["units"] == "joints_pulses":  # the controller counts whole pulses
            off = max(0.0, off - row["rounding_mm"])
        found["far"] = max(found["far"], off)
        if off > NEAR_MM:
            found["wrong"].append(f"{row['file']} line {row['line']} {row['name']}: {off:.4f} mm")


def of_dialect(dialect, count, folder):
    robot, tool, around, _ = CELLS[dialect]
    rows = yaml.safe_load((ROOT / "models" / f"{robot}.yaml").read_text())
    arms = second.Arm(rows, {}), second.Arm(rows, TRUTH["error_sources"])
    model = model_of(dialect, folder)
    found = {"moves": 0, "corrected": 0, "far": 0.0, "wrong": [], "left": collections.Counter(), "refused": collections.Counter()}
    for at in range(count):
        job = Job(arms[0], second.shift(0, 0, tool), around, np.random.default_rng([at, *map(ord, dialect)]))
        more = WRITERS[dialect](job, at)
        source = folder / dialect / f"{at:02}"
        for name, text in job.files.items():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes(text.encode())
        receipt = folder / f"{dialect}-{at:02}.json"
        done = run("correct", "--model", model, "--tool", "spindle", source, "-o", folder / f"{dialect}-out" / f"{at:02}", "--json", receipt, *more)
        if done.returncode not in (0, 1):
            found["refused"][re.sub(r"[\w./$]+ (line|row) \d+", r"FILE \1 N", done.stderr.strip().split("\n")[-1])] += 1
            found["moves"] += len(job.meant)
            continue
        result = json.loads(receipt.read_text())
        found["moves"] += result["moves"]
        found["corrected"] += result["moves_corrected"]
        check(job, result, arms, found)
    return found


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    options.add_argument("--count", type=int, default=24)
    options.add_argument("--keep", type=pathlib.Path)
    options.add_argument("dialect", nargs="?", choices=sorted(CELLS))
    asked = options.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as made:
        folder = asked.keep or pathlib.Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        for dialect in [asked.dialect] if asked.dialect else CELLS:
            found, due = of_dialect(dialect, asked.count, folder), CELLS[dialect][3]
            share = 100 * found["corrected"] / max(1, found["moves"])
            for reason, motions in found["left"].most_common():
                print(f"  {motions:4} left, {reason}")
            for reason, programs in found["refused"].most_common():
                print(f"  {programs:4} programs refused, {reason}")
            for one in found["wrong"][:20]:
                print(f"  WRONG {one}")
            print(f"figure shop floor, {dialect}: motions corrected, %: {share:.1f}")
            print(f"figure shop floor, {dialect}: farthest landing, mm: {found['far']:.5f}")
            print(f"figure shop floor, {dialect}: wrong corrections: {len(found['wrong'])}", flush=True)
            bad += len(found["wrong"]) + (share < due)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
