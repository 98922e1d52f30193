MODULE Fixtures
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  PERS wobjdata wUpper:=[FALSE,TRUE,"",[[1500,0,500],[0.996194698,0,0,0.087155743]],[[300,-250,320],[1,0,0,0]]];
  PERS wobjdata wLower:=[FALSE,TRUE,"",[[1500,-30,480],[1,0,0,0]],[[310,-220,300],[0.999048222,0,0,0.043619387]]];
  CONST robtarget pU1:=[[0,140,350],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pU2:=[[0,180,350],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pL1:=[[0,160,330],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveJ pU1,v500,z20,tSpindle\WObj:=wUpper;
    MoveL pU2,v80,fine,tSpindle\WObj:=wUpper;
    MoveL pL1,v80,fine,tSpindle\WObj:=wLower;
    MoveL Offs(pL1,-20,0,0),v80,fine,tSpindle\WObj:=wLower;
  ENDPROC
ENDMODULE
