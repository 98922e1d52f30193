MODULE Positioner
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  ! external axis a stands still: a turntable in front of the robot, locked
  CONST robtarget pA:=[[0,150,400],[0.707107,0,0.707107,0],[0,0,0,0],[35.5,9E+09,9E9,9E+09,9E9,9E9]];
  CONST robtarget pB:=[[0,200,400],[0.707107,0,0.707107,0],[0,0,0,0],[35.5,9E+09,9E9,9E+09,9E9,9E9]];
  PROC main()
    MoveL pA,v100,fine,tSpindle\WObj:=wPanel;
    MoveL pB,v100,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
