MODULE Searching
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  VAR robtarget pFound;
  VAR num nShift:=0;
  CONST robtarget pStart:=[[0,150,380],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pEnd:=[[0,200,380],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL pStart,v100,fine,tSpindle\WObj:=wPanel;
    SearchL \Stop,di_touch,pFound,pEnd,v20,tSpindle\WObj:=wPanel;
    nShift:=pFound.trans.y-150;
    MoveL Offs(pStart,0,nShift,0),v100,fine,tSpindle\WObj:=wPanel;
    MoveL Offs(pStart,0,10,0),v100,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
