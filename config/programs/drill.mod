MODULE Drill
  ! Five holes of the panel in front of cell-7, approached and left at a safe distance.
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST num nSafe:=80;
  CONST robtarget pHole{4}:=[
    [[0,0,0],[0.707107,0,0.707107,0],[-1,-1,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]],
    [[0,125,0],[0.707107,0,0.707107,0],[-1,-1,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]],
    [[0,375,0],[0.707107,0,0.707107,0],[0,0,-1,1],[9E9,9E9,9E9,9E9,9E9,9E9]],
    [[0,500,0],[0.707107,0,0.707107,0],[0,0,-1,1],[9E9,9E9,9E9,9E9,9E9,9E9]]];
  CONST robtarget pMiddle:=[[0,250.00,400.00],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST jointtarget jHome:=[[0,-20,20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

  PROC main()
    MoveAbsJ jHome\NoEOffs,v1000,z50,tSpindle;
    FOR i FROM 1 TO 4 DO
      MoveL pHole{i},v100,fine,tSpindle\WObj:=wPanel;
    ENDFOR
    MoveL Offs(pMiddle,-nSafe,0,0),v1000,z20,tSpindle\WObj:=wPanel;
    MoveL pMiddle,v50,fine,tSpindle\WObj:=wPanel;
    MoveL RelTool(pMiddle,0,0,-nSafe),v1000,z20,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
