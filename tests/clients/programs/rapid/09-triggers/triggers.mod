MODULE Triggers
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  VAR triggdata gunon;
  CONST jointtarget jHome:=[[0.00,-20.00,20.00,0.00,30.00,0.00],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pOn:=[[0,130,410],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pOff:=[[0,230,410],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    TriggIO gunon,2\DOp:=do_gun,1;
    MoveAbsJ jHome\NoEOffs,v1000,z50,tSpindle;
    TriggL pOn,v200,gunon,z5,tSpindle\WObj:=wPanel;
    TriggL pOff,v200,gunon,fine,tSpindle\WObj:=wPanel;
    MoveAbsJ [[5,-20,20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tSpindle;
  ENDPROC
ENDMODULE
