MODULE Displaced
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST robtarget pD:=[[0,160,400],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL pD,v100,fine,tSpindle\WObj:=wPanel;
    PDispOn \ExeP:=pD,pD,tSpindle;
    MoveL Offs(pD,0,20,0),v100,fine,tSpindle\WObj:=wPanel;
    PDispOff;
    MoveL Offs(pD,0,30,0),v100,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
