MODULE Arcs
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST robtarget c0:=[[0,150,400],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget c1:=[[0,175,425],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget c2:=[[0,200,400],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget c3:=[[0,175,375],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveL c0,v100,z1,tSpindle\WObj:=wPanel;
    MoveC c1,c2,v40,z1,tSpindle\WObj:=wPanel;
    MoveC c3\ID:=7,c0,v40,fine,tSpindle\WObj:=wPanel;
    MoveC Offs(c1,-5,0,0),Offs(c2,-5,0,0),v40,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
